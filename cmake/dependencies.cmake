# Everything comes from Debian packages (scripts/setup); nothing is downloaded here.
find_package(TBB REQUIRED)
find_package(embree 3 REQUIRED)
find_package(yaml-cpp REQUIRED)
find_package(Threads REQUIRED)
find_package(hwy REQUIRED)
# Every file with dispatched code sees the same targets: the scalar one always, and of ARM's only
# NEON, which is what Jetsons have. Sanitized builds have AVX2 and scalar: the dev build compares all.
set(no_targets "HWY_SVE|HWY_SVE_256|HWY_SVE2|HWY_SVE2_128")
if(MR_SANITIZE)
  string(APPEND no_targets "|HWY_AVX3|HWY_AVX3_DL|HWY_SSE4|HWY_SSSE3")
endif()
set_property(TARGET hwy::hwy APPEND PROPERTY INTERFACE_COMPILE_DEFINITIONS HWY_COMPILE_ALL_ATTAINABLE
  "HWY_DISABLED_TARGETS=(${no_targets})")
if(MR_FUSION_ONLY)
  return()
endif()

find_package(PkgConfig REQUIRED)
find_package(draco REQUIRED)
find_package(OpenCV REQUIRED COMPONENTS core imgcodecs)
find_package(FlatBuffers REQUIRED)
find_package(CLI11 REQUIRED)
find_package(fmt REQUIRED)
find_package(nlohmann_json REQUIRED)
# Header only: background models are read without its library, which would bring stb_image along.
find_path(TINYGLTF_INCLUDE_DIR tiny_gltf.h REQUIRED)
pkg_check_modules(LIBAV REQUIRED IMPORTED_TARGET libavcodec libavutil)
pkg_check_modules(LZ4 REQUIRED IMPORTED_TARGET liblz4)
pkg_check_modules(EGL REQUIRED IMPORTED_TARGET epoxy egl)
find_package(Boost 1.74 REQUIRED)
pkg_check_modules(NATS REQUIRED IMPORTED_TARGET libnats)
