// Draws one packet as a client would, for comparison with what the browser shows:
//   render_packet PACKET CAMERA.json OUT.ppm
// CAMERA.json: {"position", "target", "up", "fx", "fy", "cx", "cy", "width", "height"}; the packet
// must hold every chunk of its manifest and a key frame on every stream, on the default lattice.
#include <cstdio>
#include <fstream>
#include <nlohmann/json.hpp>

#include "mr/core/file.h"
#include "mr/node/packet_renderer.h"

namespace {

using namespace mr;
using Json = nlohmann::json;

int fail(const std::string& message) {
  std::fprintf(stderr, "render_packet: %s\n", message.c_str());
  return 1;
}

Vec3d vector(const Json& v) { return {v.at(0), v.at(1), v.at(2)}; }

}  // namespace

int main(int argc, char** argv) {
  if (argc != 4) return fail("usage: render_packet PACKET CAMERA.json OUT.ppm");
  const auto bytes = read_file(argv[1], 64u << 20);
  if (!bytes) return fail(bytes.error().message);

  const Json json = Json::parse(std::ifstream(argv[2]));
  Camera camera;
  camera.width = json.at("width"), camera.height = json.at("height");
  camera.fx = json.at("fx"), camera.fy = json.at("fy");
  camera.cx = json.at("cx"), camera.cy = json.at("cy");
  const Pose T_world_camera =
      look_at(vector(json.at("position")), vector(json.at("target")), vector(json.at("up")));

  auto renderer = node::PacketRenderer::create({});
  if (!renderer) return fail(renderer.error().message);
  if (auto ok = renderer->accept(*bytes); !ok) return fail(ok.error().message);
  const auto picture = renderer->draw(camera, T_world_camera, {.cull_back_faces = true});
  if (!picture) return fail(picture.error().message);
  std::ofstream out(argv[3], std::ios::binary);
  out << "P6\n" << picture->width << ' ' << picture->height << "\n255\n";
  out.write(reinterpret_cast<const char*>(picture->data.data()),
            static_cast<std::streamsize>(picture->data.size()));
  return out ? 0 : fail(std::string("cannot write ") + argv[3]);
}
