# Debian's aarch64 cross compiler; libraries from build/arm64-sysroot (scripts/arm64-sysroot); tests
# run under qemu-user as on the oldest Jetson: NEON and nothing newer.
set(sysroot ${CMAKE_CURRENT_LIST_DIR}/../../build/arm64-sysroot)
cmake_path(NORMAL_PATH sysroot)
if(NOT EXISTS ${sysroot}/packages)
  message(FATAL_ERROR "No ${sysroot}: run scripts/arm64-sysroot")
endif()

set(CMAKE_SYSTEM_NAME Linux)
set(CMAKE_SYSTEM_PROCESSOR aarch64)
set(CMAKE_C_COMPILER aarch64-linux-gnu-gcc)
set(CMAKE_CXX_COMPILER aarch64-linux-gnu-g++)
set(CMAKE_FIND_ROOT_PATH ${sysroot} /usr/aarch64-linux-gnu)
set(CMAKE_FIND_ROOT_PATH_MODE_PROGRAM NEVER)
set(CMAKE_FIND_ROOT_PATH_MODE_LIBRARY ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_INCLUDE ONLY)
set(CMAKE_FIND_ROOT_PATH_MODE_PACKAGE ONLY)
set(CMAKE_CROSSCOMPILING_EMULATOR qemu-aarch64;-cpu;cortex-a57;-L;/usr/aarch64-linux-gnu)
