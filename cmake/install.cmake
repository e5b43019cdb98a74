# cmake --install: the program, liboctrad.a, the public headers, and what find_package(octrad CONFIG) reads.
include(CMakePackageConfigHelpers)
set(package ${CMAKE_INSTALL_LIBDIR}/cmake/octrad)

install(TARGETS octrad_library EXPORT octradTargets)
install(DIRECTORY src/octrad DESTINATION ${CMAKE_INSTALL_INCLUDEDIR} FILES_MATCHING PATTERN "*.h"
        PATTERN "*_test_helper.h" EXCLUDE PATTERN "*_test_data.h" EXCLUDE PATTERN "check*.h" EXCLUDE
        PATTERN "random_inputs.h" EXCLUDE PATTERN "sample_*.h" EXCLUDE
        PATTERN "*-inl.h" EXCLUDE)  # the last: inside of SIMD sources
install(EXPORT octradTargets NAMESPACE octrad:: DESTINATION ${package})

configure_package_config_file(cmake/octradConfig.cmake.in octradConfig.cmake INSTALL_DESTINATION ${package}
                              NO_SET_AND_CHECK_MACRO NO_CHECK_REQUIRED_COMPONENTS_MACRO)
write_basic_package_version_file(octradConfigVersion.cmake COMPATIBILITY SameMinorVersion)
install(FILES ${PROJECT_BINARY_DIR}/octradConfig.cmake ${PROJECT_BINARY_DIR}/octradConfigVersion.cmake
              cmake/FindWebP.cmake
        DESTINATION ${package})

file(RELATIVE_PATH up /${CMAKE_INSTALL_LIBDIR}/pkgconfig /)
if(OCTRAD_CUDA_FOUND)
  set(cuda "-L${CUDAToolkit_LIBRARY_DIR} -lcudart_static -ldl -lrt -lpthread")
endif()
configure_file(cmake/octrad.pc.in octrad.pc @ONLY)
install(FILES ${PROJECT_BINARY_DIR}/octrad.pc DESTINATION ${CMAKE_INSTALL_LIBDIR}/pkgconfig)

if(OCTRAD_PROGRAM)
  install(TARGETS octrad)
endif()
install(FILES LICENSE DESTINATION ${CMAKE_INSTALL_DOCDIR})
