# The optional CUDA backend. Sets OCTRAD_CUDA_FOUND (the language is on), OCTRAD_CUDA_RUNTIME (what to link) and
# CMAKE_CUDA_ARCHITECTURES.
#
# Files named *_device.cc hold work for either device: they are compiled by nvcc where CUDA is on, and as plain C++ otherwise.
# So are files named *_device_test.cc that have kernels of their own (OCTRAD_HD is in them); the others only call the library,
# and nvcc takes more than twice as long. *.cu files exist with CUDA only.
set(OCTRAD_CUDA_FOUND OFF)
set(OCTRAD_CUDA_RUNTIME "")
set(wanted ${OCTRAD_CUDA})
if(OCTRAD_CUDA STREQUAL "auto")
  # Inside another project: where that project has turned the language on.
  set(wanted ON)
  if(NOT PROJECT_IS_TOP_LEVEL AND NOT CMAKE_CUDA_COMPILER_LOADED)
    set(wanted OFF)
  endif()
endif()
if(wanted)
  include(CheckLanguage)
  if(NOT CMAKE_CUDA_COMPILER AND NOT DEFINED ENV{CUDACXX})
    find_program(CMAKE_CUDA_COMPILER nvcc HINTS /usr/local/cuda/bin)
  endif()
  if(NOT CMAKE_CUDA_ARCHITECTURES)
    # The GPUs of this machine; without any, one that Hopper machines run and later drivers translate. Releases name
    # -DCMAKE_CUDA_ARCHITECTURES="75-real;80-real;86-real;89-real;90-real;120" (the last one also as PTX).
    execute_process(COMMAND nvidia-smi --query-gpu=compute_cap --format=csv,noheader OUTPUT_VARIABLE found ERROR_QUIET RESULT_VARIABLE status
                    OUTPUT_STRIP_TRAILING_WHITESPACE)
    string(REGEX MATCHALL "[0-9]+\\.[0-9]" found "${found}")
    list(TRANSFORM found REPLACE "\\." "")
    list(REMOVE_DUPLICATES found)
    if(NOT found)
      set(found 90)
    endif()
    set(CMAKE_CUDA_ARCHITECTURES ${found})
  endif()
  if(CMAKE_CUDA_COMPILER)
    check_language(CUDA)
  endif()
  if(CMAKE_CUDA_COMPILER)
    enable_language(CUDA)
    octrad_dependency(CUDAToolkit)
    set(OCTRAD_CUDA_FOUND ON)
    set(OCTRAD_CUDA_RUNTIME CUDA::cudart_static)
    if(CCACHE AND NOT CMAKE_CUDA_COMPILER_LAUNCHER)
      set(CMAKE_CUDA_COMPILER_LAUNCHER ${CCACHE})
    endif()
    # Keeps what the assembler says of each kernel beside the object file.
    list(PREPEND CMAKE_CUDA_COMPILER_LAUNCHER ${PROJECT_SOURCE_DIR}/cmake/ptxas_report.sh)
    message(STATUS "CUDA ${CMAKE_CUDA_COMPILER_VERSION} for ${CMAKE_CUDA_ARCHITECTURES}")
  elseif(NOT OCTRAD_CUDA STREQUAL "auto")
    message(FATAL_ERROR "OCTRAD_CUDA is on, but no nvcc was found; put it on the PATH or set CMAKE_CUDA_COMPILER")
  else()
    message(STATUS "CUDA: off (no nvcc)")
  endif()
endif()

# CMake 3.25 does not know C++20 for this nvcc: the standard is a plain option.
set(OCTRAD_CUDA_FLAGS -std=c++20 --expt-relaxed-constexpr -Xcompiler=-Wall,-Wextra,${OCTRAD_EXACT} -Xptxas=-v -lineinfo)
if(OCTRAD_WERROR)
  list(APPEND OCTRAD_CUDA_FLAGS -Werror=all-warnings)
endif()
if(OCTRAD_ASSERTS)
  list(APPEND OCTRAD_CUDA_FLAGS -UNDEBUG)
endif()

# octrad_flags(TARGET SCOPE extra...): warnings and language options for both compilers.
function(octrad_flags target)
  target_compile_features(${target} PUBLIC cxx_std_20)
  set_target_properties(${target} PROPERTIES CXX_EXTENSIONS OFF)
  target_compile_options(${target} PRIVATE "$<$<COMPILE_LANGUAGE:CXX>:${OCTRAD_FLAGS};${ARGN}>")
  if(OCTRAD_CUDA_FOUND)
    target_compile_options(${target} PRIVATE "$<$<COMPILE_LANGUAGE:CUDA>:${OCTRAD_CUDA_FLAGS}>")
    target_compile_definitions(${target} PRIVATE OCTRAD_CUDA)
    set_target_properties(${target} PROPERTIES CUDA_STANDARD_REQUIRED OFF CUDA_SEPARABLE_COMPILATION OFF)
  endif()
endfunction()

# What cuda_stream.cu says of the program.
if(OCTRAD_CUDA_FOUND)
  string(REPLACE ";" "," architectures "${CMAKE_CUDA_ARCHITECTURES}")
  set_source_files_properties(src/octrad/device/cuda_stream.cu PROPERTIES COMPILE_DEFINITIONS "OCTRAD_CUDA_ARCHITECTURES=\"${architectures}\"")
endif()

# Sets the language of the files that either compiler takes.
function(octrad_device_sources)
  if(OCTRAD_CUDA_FOUND)
    foreach(source ${ARGN})
      set(kernels "")
      if(source MATCHES "_device_test\\.cc$")
        file(STRINGS ${source} kernels REGEX OCTRAD_HD LIMIT_COUNT 1)
      endif()
      if(source MATCHES "_device\\.cc$" OR kernels)
        set_source_files_properties(${source} PROPERTIES LANGUAGE CUDA)
      endif()
    endforeach()
  endif()
endfunction()
