# tests/fuzz: every reader of files as a function of bytes. test_fuzz replays what fuzzing has found, in every build with
# tests; fuzz is the libFuzzer program of scripts/fuzz.sh (clang, -DOCTRAD_FUZZ=ON).
set(fuzz_sources tests/fuzz/targets.cc src/app/cli/query_points.cc src/app/paper/matrix.cc src/app/report/picture_origin.cc
    src/app/view/protocol.cc src/octrad/render/film.cc src/octrad/render/film_state.cc ${OCTRAD_MATRICES})
if(OCTRAD_TESTS)
  find_package(GTest REQUIRED)
  add_executable(test_fuzz ${fuzz_sources} tests/fuzz/replay.cc)
  octrad_flags(test_fuzz -Wno-conversion -O1 ${OCTRAD_SANITIZE_TESTS})
  target_compile_definitions(test_fuzz PRIVATE OCTRAD_FUZZ_FILES="${PROJECT_SOURCE_DIR}/tests/fuzz/found")
  target_link_libraries(test_fuzz PRIVATE octrad_model octrad_transport GTest::gtest GTest::gtest_main)
  add_test(NAME fuzz COMMAND test_fuzz WORKING_DIRECTORY ${PROJECT_SOURCE_DIR})
  set_tests_properties(fuzz PROPERTIES LABELS unit)
endif()
if(OCTRAD_FUZZ)
  add_executable(fuzz ${fuzz_sources} tests/fuzz/fuzz.cc tests/fuzz/mutate.cc)
  octrad_flags(fuzz -Wno-conversion)
  target_link_libraries(fuzz PRIVATE octrad_model octrad_transport ZLIB::ZLIB)
  target_link_options(fuzz PRIVATE -fsanitize=fuzzer)
endif()
