# mr_add_module(NAME SOURCES a.cpp … [USES mr::core …] [PRIVATE lib …])
#   One folder = one static library mr_NAME = one namespace. USES: our own modules that its headers
#   include. PRIVATE: libraries that only its .cpp files see.
add_library(mr_flags INTERFACE)
target_include_directories(mr_flags INTERFACE ${CMAKE_SOURCE_DIR}/src)
if(CMAKE_CXX_COMPILER_ID STREQUAL GNU)
  # -Wno-restrict: false positives of g++ 12 (its bug 105651). -Wno-subobject-linkage: a type of an unnamed
  # namespace inside a class that only this file sees; in a unity build g++ takes the file for a header.
  # -Wshadow=local: in a unity build a constant of another file is no neighbour; clang does not know it.
  # Compiled alone (scripts/test alone), every file is looked at with the whole of it.
  target_compile_options(mr_flags INTERFACE -Wno-restrict -Wno-subobject-linkage
                                            $<IF:$<BOOL:${CMAKE_UNITY_BUILD}>,-Wshadow=local,-Wshadow>)
endif()
target_compile_options(mr_flags INTERFACE -Wall -Wextra -Wnon-virtual-dtor -Wcast-qual)
if(CMAKE_CXX_COMPILER_ID STREQUAL Clang)  # `a & b` where both have to be evaluated
  target_compile_options(mr_flags INTERFACE -Wno-bitwise-instead-of-logical)
endif()
# The same floating-point results in every build: no fused multiply-add behind our back.
target_compile_options(mr_flags INTERFACE -ffp-contract=off)
if(MR_WERROR)
  target_compile_options(mr_flags INTERFACE -Werror)
endif()
if(MR_ASSERTS)
  target_compile_definitions(mr_flags INTERFACE MR_ENABLE_ASSERTS)
endif()
if(MR_SANITIZE)
  # Null pointers fault under the address sanitizer anyway; the checks left out are a third of the code.
  target_compile_options(mr_flags INTERFACE -fsanitize=${MR_SANITIZE} -fno-omit-frame-pointer -fno-sanitize-recover=all
                                            -fno-sanitize=null,object-size,pointer-overflow,vptr)
  target_link_options(mr_flags INTERFACE -fsanitize=${MR_SANITIZE})
  target_compile_definitions(mr_flags INTERFACE MR_SANITIZED)  # by whichever compiler
endif()
if(NOT MR_SANITIZE)
  include(cmake/hardening.cmake)
  mr_harden(mr_flags)
endif()
if(MR_FUZZ)
  # libFuzzer sees which branches are taken; tests link as ever. It does not see what numbers are compared
  # with: a call for each comparison would make engines and their tests several times slower.
  target_compile_options(mr_flags INTERFACE -fsanitize=fuzzer-no-link
                                            -fno-sanitize-coverage=trace-cmp,trace-div,trace-gep,indirect-calls)
endif()

function(mr_add_module name)
  cmake_parse_arguments(M "" "" "SOURCES;USES;PRIVATE" ${ARGN})
  add_library(mr_${name} STATIC ${M_SOURCES})
  add_library(mr::${name} ALIAS mr_${name})
  target_link_libraries(mr_${name} PUBLIC mr_flags ${M_USES} PRIVATE ${M_PRIVATE})
endfunction()

# mr_add_test(NAME SOURCES a_test.cpp … USES mr::… [LABELS slow] [LIGHT])
#   LIGHT: the test's own code computes little; sanitized, it is compiled without the optimiser.
function(mr_add_test name)
  cmake_parse_arguments(T "LIGHT" "" "SOURCES;USES;PRIVATE;LABELS" ${ARGN})
  add_executable(${name} ${T_SOURCES} ${CMAKE_SOURCE_DIR}/tests/support/eight_threads.cpp)
  target_include_directories(${name} PRIVATE ${CMAKE_SOURCE_DIR}/tests)
  target_link_libraries(${name} PRIVATE mr_flags ${T_USES} ${T_PRIVATE} TBB::tbb
                                        GTest::gtest_main GTest::gmock)
  if(MR_SANITIZE AND T_LIGHT)
    target_compile_options(${name} PRIVATE -O0)
  elseif(CMAKE_BUILD_TYPE STREQUAL RelWithDebInfo)  # the optimiser takes longer than the tests gain
    target_compile_options(${name} PRIVATE -O1)
  endif()
  target_compile_definitions(${name} PRIVATE MR_SOURCE_DIR="${CMAKE_SOURCE_DIR}")
  add_test(NAME ${name} COMMAND ${name} --gtest_brief=1 WORKING_DIRECTORY ${CMAKE_SOURCE_DIR})
  set(suppressions suppressions=${CMAKE_SOURCE_DIR}/tests)  # third-party libraries only
  # Up to LLVM 16 the interceptor of __tls_get_addr takes words before a block of thread-local storage
  # for a header of an old glibc, and the search for leaks then crashes at random as a test ends.
  # history_size: a report without the earlier access's stack matches no suppression.
  set_tests_properties(${name} PROPERTIES LABELS "${T_LABELS}" TIMEOUT 600 ENVIRONMENT
    "ASAN_OPTIONS=intercept_tls_get_addr=0;LSAN_OPTIONS=${suppressions}/lsan.supp;TSAN_OPTIONS=${suppressions}/tsan.supp:history_size=7")
endfunction()
