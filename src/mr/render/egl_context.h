#pragma once

#include <string>

#include "mr/core/result.h"

namespace mr::render {

/// An OpenGL 3.3 core context without a window. Owns the context; the EGL display is the process's
/// and stays initialised (other contexts may use it).
class EglContext {
 public:
  /// Tries every EGL device, hardware first, then Mesa's surfaceless platform. Leaves the context
  /// current. unsupported when none works; the message names what was tried.
  static Result<EglContext> create();
  EglContext(EglContext&& other) noexcept;
  EglContext& operator=(EglContext&& other) noexcept;
  ~EglContext();

  /// Makes it the calling thread's current context.
  Status make_current();

 private:
  EglContext(void* display, void* context) : display_(display), context_(context) {}
  static Result<EglContext> open(unsigned platform, void* native_display);

  void* display_ = nullptr;  // EGLDisplay
  void* context_ = nullptr;  // EGLContext
};

}  // namespace mr::render
