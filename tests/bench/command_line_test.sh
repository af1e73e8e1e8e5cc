#!/usr/bin/env bash
# mr-bench as a user calls it: lists, figures that add up, one clear line on what is wrong.
#   command_line_test.sh PATH/TO/mr-bench PATH/TO/meshreduce
set -uo pipefail
bench=$(realpath "$1")
meshreduce=$(realpath "$2")
here=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
export XDG_CACHE_HOME=$work/cache  # of rendered rigs
trap 'rm -rf "$work"' EXIT
cd "$work"
source "$here/tests/support/check.sh"
number() { node -e 'const o = JSON.parse(require("fs").readFileSync(0, "utf8").trimEnd().split("\n").pop()); console.log('"$1"')'; }
told() {  # told CODE NAME PATTERN ARGUMENTS...   that exit code, and one line that says why
  local code=$1 name=$2 pattern=$3
  shift 3
  check "$name" "$code" "^mr-bench: .*($pattern)" "$bench" "$@"
  [ "$("$bench" "$@" 2>&1 | wc -l)" = 1 ] || fail_test "$name: more than one line"
}
refused() { told 1 "$@"; }
misused() { told 2 "$@"; }  # the command line is wrong

check "--help" 0 "Examples" "$bench" --help
check "--list" 0 "^fuse: " "$bench" --list
check "--list names shares" 0 "^  merged/10% +the merged" "$bench" --list
check "--list names cases" 0 "^  rig +one Kinect" "$bench" --list
listed=$("$bench" --list --json | number 'o.fuse.map(c => c.case).filter(c => ["room_bench", "kitchen", "rig"].includes(c)).length')
[ "$listed" = 3 ] || fail_test "--list --json: not the three default cases ($listed)"

# A small rig as a scene: quick, and everywhere the same.
"$meshreduce" synth ./room --sensors 2 --frames 1 --depth-mode nfov_binned --color 320x180 >/dev/null
sed -i 's/voxel_m: [0-9.]*/voxel_m: 0.04/; s/truncation_m: [0-9.]*/truncation_m: 0.16/' room/scene.yaml
grep -q "voxel_m: 0.04" room/scene.yaml || fail_test "the scene has no voxel_m"
"$bench" fuse --input room/scene.yaml --case cam-0 --runs 3 --json >out.json 2>err.txt || fail_test "fuse: $(cat err.txt)"
figures=$(number '(() => {
  const ours = o.results.filter(r => r.impl == "ours");
  const sound = r => r.case == "cam-0" && r.ms > 0 && r.p95_ms >= r.ms && r.runs == 3 && r.triangles > 1000 && r.area_m2 > 5;
  const one = ours[0], two = ours[1];
  return ours.length == 2 && ours.every(sound) && one.threads == 1 && two.threads == 2 && one.triangles == two.triangles
      && one.stages.extract > 0 && o.input["cam-0"].width == 320 && o.stage == "fuse"; })()' <out.json)
[ "$figures" = true ] || fail_test "fuse: implausible figures: $(cat out.json)"
# The peer, where it is installed: ratios are what the results say.
ratios=$(number '(() => {
  if (o.absent.includes("open3d")) return Object.keys(o.ratio).length == 0;
  return [1, 2].every(t => { const of = i => o.results.find(r => r.impl == i && r.threads == t);
    const ours = of("ours"), peer = of("open3d");
    return peer.aborted || Math.abs(o.ratio[`open3d/cam-0/t${t}`] - peer.ms / ours.ms) < 0.01
        && ours.to_peer_rms_mm >= 0 && Math.abs(peer.area_m2 / ours.area_m2 - 1) < 0.3; }); })()' <out.json)
[ "$ratios" = true ] || fail_test "fuse: ratios do not fit the results: $(cat out.json)"
check "a table for people" 0 "^cam-1 +1 ours" "$bench" fuse --input room/scene.yaml --case cam-1 --runs 1 --threads 1

# Decimation of the same: whole-mesh peers run on one thread, and face ours on any number.
"$bench" simplify --input room/scene.yaml --case "cam-0/10%" --runs 1 --plot plot.svg --json >out.json 2>err.txt || fail_test "simplify: $(cat err.txt)"
figures=$(number '(() => {
  const wanted = o.input["cam-0/10%"].wanted_triangles, at = (i, t) => o.results.find(r => r.impl == i && r.threads == t);
  const near = r => r.case == "cam-0/10%" && r.ms > 0 && Math.abs(r.triangles / wanted - 1) < 0.05 && r.rms_mm > 0
      && r.rms_mm == Math.max(r.to_input_rms_mm, r.from_input_rms_mm) && r.max_mm >= r.p95_mm && r.rms_mm < 100;
  const ours = [at("ours", 1), at("ours", 2)], raced = !o.absent.includes("meshoptimizer");
  const peers = raced ? ["meshoptimizer", "heap"] : ["heap"], whole = peers.map(p => at(p, 1));
  return Math.abs(wanted / o.input["cam-0/10%"].triangles - 0.1) < 0.001 && [...ours, ...whole].every(near)
      && ours[0].rms_mm == ours[1].rms_mm && !at("heap", 2) && (!raced || at("meshoptimizer/patches", 2).ms > 0) && o.stage == "simplify"
      && peers.every((p, i) => [1, 2].every(t => Math.abs(o.ratio[`${p}/cam-0/10%/t${t}`] - whole[i].ms / ours[t - 1].ms) < 0.01))
      && ["open3d", "cgal", "meshoptimizer"].every(p => o.absent.includes(p) != o.results.some(r => r.impl == p)); })()' <out.json)
[ "$figures" = true ] || fail_test "simplify: implausible figures: $(cat out.json)"
grep -q "Worst error" plot.svg || fail_test "simplify --plot: $(head -c 300 plot.svg)"
check "a figure where there is none" 2 "mr-bench: fuse draws no figure" "$bench" fuse --plot plot.svg

# Layers: a rig of its own, as it takes 160 captures.
cat >layers.yaml <<'END'
scene: layers
up: [0, 0, 1]
voxel_m: 0.04
rig: {type: synthetic, seed: 3, room: [4, 3.5, 2.6], people: 1, sensors: 2, depth_mode: nfov_binned, color: [160, 90], frames: 160, loop: true}
simplify: {ratio: 0.2}
END
"$bench" layers --input layers.yaml --json >out.json 2>err.txt || fail_test "layers: $(cat err.txt)"
figures=$(number '(() => {
  const [ours, everything] = ["ours", "everything"].map(i => o.results.find(r => r.impl == i && r.case == "layers"));
  const sound = r => r.ms > 0 && Math.abs(r.nodes.sensor + r.nodes.merge - r.ms) < 0.01 && r.head_bytes > 0 && r.texture_bytes > 0 && r.critical_path_ms > 0;
  const near = (key, of) => Math.abs(o.ratio["everything/layers/" + key] - of(everything) / of(ours)) < 0.01;
  return sound(ours) && sound(everything) && ours.runs == 60 && everything.runs == 20 && ours.learn_bytes > 60 * ours.mesh_bytes
      && ["ms", "mesh_bytes", "texture_bytes", "critical_path_ms"].every(key => near(key, r => r[key]))
      && near("mesh_and_head_bytes", r => r.mesh_bytes + r.head_bytes) && o.ratio["everything/layers/mesh_bytes"] > 2 && o.stage == "layers"; })()' <out.json)
[ "$figures" = true ] || fail_test "layers: implausible figures: $(cat out.json)"
refused "layers: a case of a scene" "no --case with --input" layers --input layers.yaml --case still

# A LiDAR scan beside the room of fuse.
"$bench" scan --case scan --threads 1 --runs 3 --json >out.json 2>err.txt || fail_test "scan: $(cat err.txt)"
figures=$(number '(() => {
  const ours = o.results.find(r => r.impl == "ours"), room = o.results.find(r => r.impl == "fuse-room");
  return ours.case == "scan" && ours.runs == 3 && ours.area_m2 > 90 && ours.to_truth_rms_mm < 30 && o.input.scan.width == 2048 && o.input.scan.height == 128
      && room.triangles > 1000 && Math.abs(o.ratio["fuse-room/scan/t1"] - room.ms / ours.ms) < 0.01 && o.stage == "scan"; })()' <out.json)
[ "$figures" = true ] || fail_test "scan: implausible figures: $(cat out.json)"
refused "scan: a scene" "scan takes no --input" scan --input room/scene.yaml

misused "no stage" "name a stage"
misused "unknown stage" "no stage 'fusion'.*did you mean 'fuse'" fusion
refused "unknown case" "no case 'nothing'" fuse --case nothing
refused "unknown share" "no case '7%'" simplify --case 7%
refused "no such sensor's share" "no case 'cam-9/10%'" simplify --input room/scene.yaml --case cam-9/10%
misused "unknown option" "nonsense" fuse --nonsense
misused "no threads" "threads" fuse --threads 0
misused "no number of threads" "threads" fuse --threads two
refused "no scene" "missing.yaml" fuse --input missing.yaml
refused "no such sensor" "sensor 'cam-9'" fuse --input room/scene.yaml --case cam-9
MR_DATA=$work refused "no recordings" "room_bench.*MR_DATA" fuse --case room_bench
MR_DATA=$work refused "no merged surface" "merged/10%.*MR_DATA" simplify --case merged/10%
sed 's/voxel_m: 0.04/voxel_m: -1/' room/scene.yaml >room/wrong.yaml
refused "a scene with a problem" "wrong.yaml:[0-9]+: .*voxel_m" fuse --input room/wrong.yaml
sed 's/voxel_m: 0.04/voxel_m: -1/; s/^fps: 30/fps: -3/' room/scene.yaml >room/wrong.yaml
check "a scene with two" 1 "mr-bench: 2 problems in " "$bench" fuse --input room/wrong.yaml
head -c 100 room/cam-0/depth/000000.png >cut.png && cp cut.png room/cam-0/depth/000000.png
check "a cut picture" 1 "dropped: .*000000.png" "$bench" fuse --input room/scene.yaml --case cam-0

finish
