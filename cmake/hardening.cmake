# What reads other people's bytes is built so that an overrun ends the process in place of running on:
# overwritten stacks and buffers are noticed, nothing lies at a known address, and no table of functions
# can be written once the program runs. tests/structure/hardening_test.sh looks at what came out.
#
# Not with sanitizers, which find the same and more, and whose own versions of memcpy and the like
# _FORTIFY_SOURCE would go around. Not -D_GLIBCXX_ASSERTIONS: it checks every index of every vector,
# which the inner loops of fusion and simplification pay for; our own checks stand where bytes come in.
include(CheckCXXCompilerFlag)

check_cxx_compiler_flag(-fstack-clash-protection MR_HAS_STACK_CLASH_PROTECTION)
check_cxx_compiler_flag(-fcf-protection=full MR_HAS_CF_PROTECTION)  # x86 only

function(mr_harden target)
  target_compile_options(${target} INTERFACE -fstack-protector-strong -fPIE
    $<$<BOOL:${MR_HAS_STACK_CLASH_PROTECTION}>:-fstack-clash-protection>
    $<$<BOOL:${MR_HAS_CF_PROTECTION}>:-fcf-protection=full>)
  # Level 3 also knows sizes that are computed at run time; older compilers warn about it. glibc wants
  # the optimiser.
  set(level 2)
  if((CMAKE_CXX_COMPILER_ID STREQUAL GNU AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 12)
     OR (CMAKE_CXX_COMPILER_ID STREQUAL Clang AND CMAKE_CXX_COMPILER_VERSION VERSION_GREATER_EQUAL 9))
    set(level 3)
  endif()
  target_compile_options(${target} INTERFACE
    $<$<CONFIG:Release,RelWithDebInfo,MinSizeRel>:-U_FORTIFY_SOURCE;-D_FORTIFY_SOURCE=${level}>)
  target_link_options(${target} INTERFACE -pie -Wl,-z,relro,-z,now,-z,noexecstack)
endfunction()
