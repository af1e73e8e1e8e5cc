#include "mr/runtime/monitor.h"

#include <gtest/gtest.h>

namespace mr::runtime {
namespace {

using node::NodeStats;

std::vector<NodeStats> room() {
  NodeStats cam{
      "cam-0", 100, {{"cam-0: raw frames that it had no time for", 3}}, {{"fuse", {10, 20}}}, 5000};
  NodeStats root{"root", 90, {}, {}, 9000};
  root.inputs = {{"cam-0", true}, {"cam-1", false}};
  root.clock_offsets_s = {{"cam-0", -1.0}};
  NodeStats gateway{"gateway", 90, {}, {}, 9000};
  gateway.inputs = {{"cam-0", true}, {"cam-1", false}};
  gateway.viewers = {2, 12345, 17};
  return {cam, root, gateway};
}

TEST(Monitor, HealthNamesWhoIsMissing) {
  EXPECT_EQ(health_of(room()).missing, std::vector<std::string>{"cam-1"});
  EXPECT_EQ(health_of(room()).status, Health::Status::degraded);
  EXPECT_TRUE(
      health_json(room(), true).starts_with("{\"status\":\"degraded\",\"missing\":[\"cam-1\"]"));
  EXPECT_EQ(health_json(room(), false), "{\"status\":\"degraded\"}\n");
  auto nodes = room();
  nodes[2].is_silent = true;
  EXPECT_EQ(health_of(nodes).status, Health::Status::down);
  int made = 0;
  Monitor monitor([&] { return ++made, nodes; });
  EXPECT_EQ(monitor.page("/healthz", false)->status, 503);
  EXPECT_EQ(monitor.page("/metrics", false)->status, 401);
  EXPECT_FALSE(monitor.page("/", true));
  for (int i = 0; i < 100; ++i) monitor.page("/metrics", true);
  EXPECT_LE(made, 3) << "made anew now and then, however often somebody asks";
  NodeStats cam;
  cam.id = "cam-1";
  cam.is_silent = true;
  EXPECT_EQ(health_of({cam}).status, Health::Status::down) << "a process of one sensor";
  EXPECT_EQ(health_of({cam}).missing, std::vector<std::string>{"cam-1"});
}

TEST(Monitor, MetricsAreInPrometheusText) {
  const std::string text = metrics_text(room());
  for (const char* line :
       {"# TYPE meshreduce_packets_total counter", "meshreduce_packets_total{node=\"cam-0\"} 100",
        "meshreduce_packet_bytes_total{node=\"root\"} 9000",
        "meshreduce_stage_seconds{node=\"cam-0\",stage=\"fuse\",percentile=\"50\"} 0.015",
        "meshreduce_drops_total{node=\"cam-0\",cause=\"cam-0: raw frames that it had no time "
        "for\"} 3",
        "meshreduce_input_up{node=\"gateway\",input=\"cam-1\"} 0",
        "meshreduce_clock_offset_seconds{node=\"root\",input=\"cam-0\"} -1", "meshreduce_viewers 2",
        "meshreduce_viewer_sent_bytes_total 12345", "meshreduce_resident_bytes "})
    EXPECT_NE(text.find(line), std::string::npos) << line << "\n" << text;
}

}  // namespace
}  // namespace mr::runtime
