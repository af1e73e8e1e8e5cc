#!/usr/bin/env bash
# The commands as a user calls them: right exit codes, one clear line on what is wrong, no partial files.
#   command_line_test.sh PATH/TO/meshreduce
set -uo pipefail
meshreduce=$(realpath "$1")
here=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
export XDG_CACHE_HOME=$work/cache  # of rendered rigs
trap 'rm -rf "$work"' EXIT
cd "$work"
source "$here/tests/support/check.sh"

cat >room.yaml <<'YAML'
scene: room
up: [0, 0, 1]
voxel_m: 0.04
rig: {type: synthetic, seed: 1, sensors: 2, depth_mode: nfov_binned, color: [320, 180]}
fusion: {truncation_m: 0.16}
simplify: {ratio: 0.3}
YAML

check "--version" 0 "^meshreduce [0-9]+\.[0-9]+\.[0-9]+$" "$meshreduce" --version
check "--version names libavcodec" 0 "libavcodec [0-9.]+, licence: .*GPL" "$meshreduce" --version
check "--help tells exit codes" 0 "Exit code: 0 done, 1 it failed, 2 " "$meshreduce" --help
misused() {  # misused NAME PATTERN ARGUMENTS...   exit code 2, and one line that says why
  local name=$1 pattern=$2
  shift 2
  check "$name" 2 "^meshreduce: .*($pattern)" "$meshreduce" "$@"
  [ "$("$meshreduce" "$@" 2>&1 | wc -l)" = 1 ] || fail_test "$name: more than one line"
}
misused "a command with a letter too few" "no command 'dem' \(did you mean 'demo'\?\); meshreduce --help" dem
misused "a command with a letter too many" "did you mean 'run'" runn room.yaml
misused "a wrong command of eval" "no command 'sim' \(did you mean 'ssim'\?\); meshreduce eval --help" eval sim
misused "a word like no command" "no command 'calibrate';" calibrate
misused "a scene as the command" "meshreduce run room.yaml" room.yaml
misused "a wrong option" "run has no option '--frame' \(did you mean '--frames'\?\)" run room.yaml --frame=3
misused "an option before the command" "no option '--frames'" --frames 3 run room.yaml
misused "no scene" "SCENE is required; meshreduce run --help" run
misused "a number that is none" "--frames.*meshreduce run --help" run room.yaml --frames many
misused "demo --frames without --no-viewer" "no-viewer" demo --frames 3
check "no command" 2 "^Usage: meshreduce" "$meshreduce"
check "no command of eval" 2 "^Usage: meshreduce eval" "$meshreduce" eval
for command in run demo export info; do check "$command --help" 0 Example "$meshreduce" $command --help; done
check "no such scene" fails "missing.yaml" "$meshreduce" run missing.yaml
check "info" 0 "2 sensors" "$meshreduce" info room.yaml
check "info of a rig that is rendered" 0 "^fit: good" "$meshreduce" info room.yaml --pictures
check "info as JSON" 0 '"sensors"' "$meshreduce" info room.yaml --json
check "run" 0 "triangles" "$meshreduce" run room.yaml --frames 2 --export out.glb --report out.json --snapshot pictures
for file in out.glb out.json pictures/above.png; do
  [ -s "$file" ] || fail_test "run: no $file"
done
check "Khronos validator" 0 "" node "$here/tests/tools/validate_gltf.mjs" out.glb
check "export PLY" 0 "triangles" "$meshreduce" export room.yaml out.ply
check "upper-case ending" 0 "triangles" "$meshreduce" export room.yaml OUT.PLY
mkdir folder.glb
check "export to a folder" fails "it is a folder" "$meshreduce" export room.yaml folder.glb
check "export OBJ" 0 "triangles" "$meshreduce" export room.yaml out.obj
check "unknown ending" fails "\.glb, \.ply or \.obj" "$meshreduce" export room.yaml out.stl
check "no such folder" fails "no folder" "$meshreduce" run room.yaml --export nowhere/out.glb

check "--set" 0 "2 sensors.*15 fps" "$meshreduce" info room.yaml --set fps=15
check "--set, an item and a map" 0 "waits 70 ms" "$meshreduce" info room.yaml --set 'mergers=[{id: r, inputs: [cam-0, cam-1]}]' \
  --set mergers.r.deadline_ms=70 --set gateway.listen=127.0.0.1:81
check "--set before the file" 0 "3 sensors" "$meshreduce" info --set rig.sensors=3 room.yaml
for option in fps=fast fpss=3 fps fps.x=1 mergers.0=1 'rig.sensors=[1'; do
  check "--set $option" fails "^--set '" "$meshreduce" run room.yaml --set "$option" --frames 1
  lines=$("$meshreduce" run room.yaml --set "$option" --frames 1 2>&1 | wc -l)
  [ "$lines" -eq 1 ] || fail_test "--set $option: $lines lines"
done
for command in "run room.yaml" "node room.yaml root" "export room.yaml o.ply" "info room.yaml" "plan room.yaml --mergers 1" demo \
  "eval ssim room.yaml" "eval geometry room.yaml" "eval views room.yaml" "eval compare room.yaml" "eval match room.yaml --mbps 5" \
  "eval rd room.yaml" "eval features room.yaml"; do
  check "$command --set" fails "^--set 'fps=-1': fps must be greater than 0" "$meshreduce" $command --set fps=-1
done
check "plan --set --write" fails "not change" "$meshreduce" plan room.yaml --mergers 1 --set fps=10 --write o.yaml
check "--set of a PLY" fails "are for scenes" "$meshreduce" eval geometry a.ply b.ply --set fps=10
check "what is not acted on" 0 "note: --set 'atlas.views=packed': atlas.views packed: accepted, but not acted on" \
  "$meshreduce" info room.yaml --set atlas.views=packed

printf 'scene: bad\nvoxl_m: 1\nup: [0, 0, 0]\nsensors: []\n' >bad.yaml
check "unknown key, line 2" fails "bad.yaml:2:.*voxl_m" "$meshreduce" run bad.yaml
check "zero up, line 3" fails "bad.yaml:3:" "$meshreduce" run bad.yaml
cat >far.yaml <<'YAML'
scene: far
sensors:
  - id: a
    source: {type: rgbd-images, depth: ["d.png"]}
    depth_camera: {model: pinhole, size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    T_world_depth: [1, 0, 0, 2500, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
YAML
check "a pose in millimetres, line 3" fails "far.yaml:3:.*metres" "$meshreduce" info far.yaml
mkdir empty
cat >empty.yaml <<'YAML'
scene: empty
sensors:
  - id: a
    source: {type: rgbd-images, color: {pattern: "empty/%06d.jpg", first: 0, last: 9}, depth: {pattern: "empty/%06d.png", first: 0, last: 9}}
    depth_camera: {model: pinhole, size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    color_camera: {model: pinhole, size: [640, 480], fx: 585, fy: 585, cx: 320, cy: 240}
    T_world_depth: [1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]
YAML
check "an empty folder" fails "empty.yaml:4:.*empty/000000" "$meshreduce" run empty.yaml

# Recordings that are not here: one line, which names the variable and the folder.
missing=$(MR_DATA=$work/nowhere "$meshreduce" info "$here/examples/red-kitchen.yaml" 2>&1)
[ $? = 1 ] && [ "$(wc -l <<<"$missing")" = 1 ] || fail_test "missing recordings: $missing"
grep -qE "no folder '$work/nowhere', where 24 files.*set MR_DATA to the folder that holds 'sevenscenes" <<<"$missing" ||
  fail_test "missing recordings: $missing"

# Folders that are no data set
mkdir -p recordings/none && touch recordings/a.mkv recordings/b.bag
check "info of a folder of recordings" 1 "is a folder of recordings: name one, such as 'recordings/a.mkv' .and 1 more." \
  "$meshreduce" info recordings
check "info of another folder" 1 "is of no format that is known: .*Ouster metadata" "$meshreduce" info recordings/none
check "import of another folder" 1 "is of no format that is known: Azure.*cwipc recording$" "$meshreduce" import recordings/none

# Rigs as pictures
check "synth KIND" 2 "'office' is a kind of room, not a folder: meshreduce synth FOLDER --kind office" "$meshreduce" synth office
[ ! -e office ] || fail_test "synth office wrote a folder"
check "synth as bag" 2 "format.*images.*mkv.*tum" "$meshreduce" synth pictures-of --format bag
check "synth as mkv of another size" 1 "Azure Kinect cannot record colour of 640x480 pixels; it has 1280x720" \
  "$meshreduce" synth pictures-of --format mkv --color 640x480
[ ! -e pictures-of ] || fail_test "synth of a size that cannot be recorded wrote a folder"
check "synth ./KIND" 0 "2 sensors, 1 frames" "$meshreduce" synth ./office --sensors 2 --frames 1 --people 0 \
  --depth-mode nfov_binned --color 320x180

# Holes in a recording: the rest runs, and each lost frame is told once, without what follows from it.
check "synth with holes" 0 "2 sensors, 4 frames" "$meshreduce" synth holes --sensors 2 --frames 4 --people 0 \
  --depth-mode nfov_binned --color 320x180
for lost in cam-0/depth/000001 cam-0/depth/000003 cam-1/depth/000003; do echo x >holes/$lost.png; done
rm holes/cam-1/color/000000.png
check "run with holes" 0 "2 sensors, 3 frames" "$meshreduce" run holes/scene.yaml --frames 9
told=$("$meshreduce" run holes/scene.yaml --frames 9 2>&1 >/dev/null)
for line in "^note: .*: sensors.cam-1.source.color: 1 of the 4 files of the pattern is missing" \
  "^dropped: cam-0: .*000001.png: .*\(frame 1 of sensor 'cam-0' is lost\)$" "^dropped: cam-1: .*000000.png: .*\(frame 0 of sensor 'cam-1' is lost\)$" \
  "^dropped: cam-0: .*\(frame 3 of" "^dropped: cam-1: .*\(frame 3 of"; do
  grep -qE "$line" <<<"$told" || fail_test "holes: no '$line' in: $told"
done
[ "$(wc -l <<<"$told")" = 5 ] || fail_test "holes: not 5 lines: $told"
timeout -k 1 60 "$meshreduce" run holes/scene.yaml --seconds 4 --listen 127.0.0.1:0 >/dev/null 2>&1 || fail_test "live with holes: exit $?"

# info looks at the pictures, and says what is wrong with them.
info() { "$meshreduce" info "$@" 2>&1; }
variant() { sed "$2" office/scene.yaml >office/$1.yaml; }  # of the scene, beside it
check "info of pictures" 0 "first pictures: depth 320x288, [0-9]+ % valid, .*color 320x180" info office/scene.yaml
check "info rates the fit" 0 "^fit: good; median [0-9.]+ mm over 1 pairs" info office/scene.yaml
figures=$("$meshreduce" info office/scene.yaml --json | node -e '
  const o = JSON.parse(require("fs").readFileSync(0)), p = o.sensors[0].pictures, d = p.depth_m;
  console.log(o.fit.rating == "good" && o.fit.pairs[0].residual_mm > 0 && p.depth[0] == 320 && p.color[1] == 180
      && p.valid_ratio > 0.5 && 0.3 < d.min && d.min < d.median && d.median < d.max && d.max < 10 && p.hints.length == 0)')
[ "$figures" = true ] || fail_test "info --json: implausible figures"
variant unit 's/depth_unit_m: [0-9.]*/depth_unit_m: 1/'
check "a wrong unit" 0 "! the median depth is [0-9]+ m: check depth_unit_m, now 1; with millimetres, 0.001, it would be [1-9]" info office/unit.yaml
variant near 's/depth_range_m: .*/depth_range_m: [0.1, 0.5]/'
check "a wrong range" 0 "! [0-9]+ % of the pixels with depth lie outside depth_range_m \[0.1, 0.5\]" info office/near.yaml
cp office/cam-0/depth/000000.png whole.png
head -c 100 whole.png >office/cam-0/depth/000000.png
check "a cut picture" 1 "meshreduce: sensor cam-0: .*000000.png" info office/scene.yaml
check "the other sensor beside a cut picture" 1 "first pictures" info office/scene.yaml
check "a cut picture that is not opened" 0 "2 sensors" info office/scene.yaml --no-pictures
cp whole.png office/cam-0/depth/000000.png

# A disk that is full: files over 32 kB cannot be written.
mkdir full
for ending in glb ply obj; do
  check "full disk, $ending" fails "full/out" \
    bash -c "trap '' XFSZ; ulimit -f 32; exec '$meshreduce' export room.yaml full/out.$ending"
  [ -z "$(ls -A full)" ] || { fail_test "full disk: left $(ls full)"; rm -rf full/*; }
done
finish
