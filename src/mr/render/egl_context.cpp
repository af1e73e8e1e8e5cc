#include "mr/render/egl_context.h"

#include <epoxy/egl.h>
#include <epoxy/gl.h>

#include <algorithm>
#include <array>
#include <string>
#include <utility>
#include <vector>

namespace mr::render {
namespace {

Error unsupported(std::string message) { return {Error::Cause::unsupported, std::move(message)}; }

bool client_has(const char* extension) {
  return epoxy_has_egl_extension(EGL_NO_DISPLAY, extension);
}

bool is_software(EGLDeviceEXT device) {
  const char* extensions = eglQueryDeviceStringEXT(device, EGL_EXTENSIONS);
  return extensions &&
         std::string(extensions).find("EGL_MESA_device_software") != std::string::npos;
}

/// Every EGL device, those without hardware last.
std::vector<EGLDeviceEXT> devices() {
  const bool base = client_has("EGL_EXT_device_base");
  if (!client_has("EGL_EXT_platform_device") || !(base || client_has("EGL_EXT_device_enumeration")))
    return {};
  std::array<EGLDeviceEXT, 64> all{};
  EGLint count = 0;
  if (!eglQueryDevicesEXT(static_cast<EGLint>(all.size()), all.data(), &count)) return {};
  std::vector<EGLDeviceEXT> out(all.begin(), all.begin() + count);
  if (base || client_has("EGL_EXT_device_query"))
    std::stable_partition(out.begin(), out.end(), [](EGLDeviceEXT d) { return !is_software(d); });
  return out;
}

/// A config that can draw OpenGL, or none where contexts need none.
EGLConfig choose_config(EGLDisplay display) {
  if (epoxy_has_egl_extension(display, "EGL_KHR_no_config_context")) return EGL_NO_CONFIG_KHR;
  const EGLint wanted[] = {EGL_SURFACE_TYPE, EGL_PBUFFER_BIT, EGL_RENDERABLE_TYPE, EGL_OPENGL_BIT,
                           EGL_NONE};
  EGLConfig config = nullptr;
  EGLint count = 0;
  eglChooseConfig(display, wanted, &config, 1, &count);
  return count > 0 ? config : nullptr;
}

}  // namespace

Result<EglContext> EglContext::create() {
  if (!client_has("EGL_EXT_platform_base"))
    return unsupported("EGL cannot draw offscreen here: EGL_EXT_platform_base is missing");
  std::string tried;
  const auto attempt = [&](unsigned platform, void* native, const std::string& name) {
    auto context = open(platform, native);
    if (!context) tried += (tried.empty() ? "" : "; ") + name + ": " + context.error().message;
    return context;
  };
  int index = 0;
  for (EGLDeviceEXT device : devices())
    if (auto context =
            attempt(EGL_PLATFORM_DEVICE_EXT, device, "device " + std::to_string(index++)))
      return context;
  if (client_has("EGL_MESA_platform_surfaceless"))
    if (auto context = attempt(EGL_PLATFORM_SURFACELESS_MESA, nullptr, "surfaceless"))
      return context;
  return unsupported("no EGL device can draw OpenGL 3.3 (" +
                     (tried.empty() ? "none found" : tried) +
                     "); install libegl-mesa0 and libgl1-mesa-dri");
}

Result<EglContext> EglContext::open(unsigned platform, void* native_display) {
  const EGLDisplay display = eglGetPlatformDisplayEXT(platform, native_display, nullptr);
  if (display == EGL_NO_DISPLAY || !eglInitialize(display, nullptr, nullptr))
    return unsupported("does not initialise");
  if (!epoxy_has_egl_extension(display, "EGL_KHR_surfaceless_context") ||
      epoxy_egl_version(display) < 15)
    return unsupported("EGL 1.5 and surfaceless contexts are needed");
  if (!eglBindAPI(EGL_OPENGL_API)) return unsupported("has no desktop OpenGL");
  const EGLint attributes[] = {EGL_CONTEXT_MAJOR_VERSION,
                               3,
                               EGL_CONTEXT_MINOR_VERSION,
                               3,
                               EGL_CONTEXT_OPENGL_PROFILE_MASK,
                               EGL_CONTEXT_OPENGL_CORE_PROFILE_BIT,
                               EGL_NONE};
  const EGLContext context =
      eglCreateContext(display, choose_config(display), EGL_NO_CONTEXT, attributes);
  if (context == EGL_NO_CONTEXT) return unsupported("no OpenGL 3.3 core context");
  EglContext owned(display, context);
  if (auto ok = owned.make_current(); !ok) return ok.error();
  return owned;
}

EglContext::EglContext(EglContext&& other) noexcept
    : display_(std::exchange(other.display_, nullptr)),
      context_(std::exchange(other.context_, nullptr)) {}

EglContext& EglContext::operator=(EglContext&& other) noexcept {
  std::swap(display_, other.display_);
  std::swap(context_, other.context_);
  return *this;
}

EglContext::~EglContext() {
  if (!context_) return;
  if (eglGetCurrentContext() == context_)
    eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, EGL_NO_CONTEXT);
  eglDestroyContext(display_, context_);
}

Status EglContext::make_current() {
  if (!eglMakeCurrent(display_, EGL_NO_SURFACE, EGL_NO_SURFACE, context_))
    return unsupported("the OpenGL context cannot be used without a surface");
  return {};
}

}  // namespace mr::render
