# octrad::octrad: all modules in one static library, liboctrad.a. (The target octrad is the program.)
set(modules base image device scene geometry shading transport encoding network model perceptual train render)
list(TRANSFORM modules REPLACE "(.+)" "$<TARGET_OBJECTS:octrad_\\1>" OUTPUT_VARIABLE objects)
add_library(octrad_library STATIC ${objects})
add_library(octrad::octrad ALIAS octrad_library)
set_target_properties(octrad_library PROPERTIES OUTPUT_NAME octrad EXPORT_NAME octrad LINKER_LANGUAGE CXX)
target_compile_features(octrad_library PUBLIC cxx_std_20)
target_compile_options(octrad_library INTERFACE $<$<COMPILE_LANGUAGE:CXX>:${OCTRAD_EXACT}>
                                                $<$<COMPILE_LANGUAGE:CUDA>:-Xcompiler=${OCTRAD_EXACT}>)
target_include_directories(octrad_library PUBLIC $<BUILD_INTERFACE:${PROJECT_SOURCE_DIR}/src>
                                                 $<INSTALL_INTERFACE:${CMAKE_INSTALL_INCLUDEDIR}>)
target_link_libraries(octrad_library PUBLIC fmt::fmt nlohmann_json::nlohmann_json
                      PRIVATE TBB::tbb embree OpenEXR::OpenEXR PNG::PNG JPEG::JPEG WebP::webp pugixml::pugixml
                              ZLIB::ZLIB meshoptimizer::meshoptimizer hwy::hwy ${OCTRAD_CUDA_RUNTIME})
