#!/usr/bin/env bash
# The eval commands as a user calls them: figures that add up, one clear line on what is wrong, nothing partial left.
#   command_line_test.sh PATH/TO/meshreduce
set -uo pipefail
meshreduce=$(realpath "$1")
here=$(cd "$(dirname "$0")/../.." && pwd)
work=$(mktemp -d)
export XDG_CACHE_HOME=$work/cache  # of rendered rigs, references and sweeps
trap 'rm -rf "$work"' EXIT
cd "$work"
source "$here/tests/support/check.sh"
measure() { "$meshreduce" eval "$@"; }
absent() { for file in "$@"; do [ ! -e "$file" ] || fail_test "$file was left behind"; done; }
number() { node -e 'const o = JSON.parse(require("fs").readFileSync(0)); console.log('"$1"')'; }  # JSON on stdin

"$meshreduce" synth ./room --sensors 2 --frames 3 --people 1 --depth-mode nfov_binned --color 320x180 >/dev/null
scene=room/scene.yaml
sed -i 's/voxel_m: 0.02/voxel_m: 0.04/' $scene
without() { sed "$2" $scene >room/$1.yaml; }  # a variant of the scene, beside it
without colourless 's/color: {pattern[^}]*}, //; /color_camera:/d; /T_color_depth:/d'
without elsewhere 's/^fps: 30/fps: 30\nvolume: {box: [[90, 90, 90], [91, 91, 91]]}/'
without sliver 's/^fps: 30/fps: 30\nvolume: {box: [[-0.3, -0.3, -0.2], [0.3, 0.3, 0.1]]}/'
without untrue 's/^truth:.*//'

for command in "" ssim geometry views compare match rd rate features still scene photos; do check "eval $command --help" 0 "Example|COMMAND" measure $command --help; done

# Pictures
pictures=$here/tests/data/ssim
two=$(ls "$pictures"/*.png | head -2)
check "two pictures" 0 "SSIM 0\.[0-9]{4}, PSNR" measure ssim $two
check "a picture and itself" 0 '"ssim": 1.000000' measure ssim ${two%%$'\n'*} ${two%%$'\n'*} --json
check "sizes differ" fails "differ in size" measure ssim ${two%%$'\n'*} room/cam-0/color/000000.png
check "one picture" fails "name two" measure ssim ${two%%$'\n'*}
check "two pictures and a pipeline" fails "for scenes" measure ssim $two --pipeline rgbd
check "no such picture" fails "missing.png" measure ssim missing.png missing.png
head -c 60 ${two%%$'\n'*} >cut.png
check "cut picture" fails "cut.png" measure ssim cut.png cut.png

# A scene
check "views" 0 "viewpoints" measure views $scene --plan plan.svg
grep -q "</svg>" plan.svg || fail_test "views: no plan drawn"
check "ssim" 0 '"masked"' measure ssim $scene --json --reference monolithic --moments 1 --burst 2
masked=$(measure ssim $scene --json --reference monolithic --moments 1 --burst 2 2>/dev/null | number 'o.ssim.masked.mean > 0.3 && o.ssim.masked.mean < 1 && o.mbps > 1 && o.views > 0 && o.reference')
[ "$masked" = monolithic ] || fail_test "ssim: implausible figures ($masked)"
check "ssim of a baseline" 0 '"rgbd"' measure ssim $scene --json --reference monolithic --moments 1 --burst 2 --pipeline rgbd
check "geometry" 0 '"duplicate_ratio"' measure geometry $scene --json
rms=$(measure geometry $scene --json 2>/dev/null | number 'o.reference == "truth" && o.to_reference.rms_mm > 0.5 && o.to_reference.rms_mm < 60 && o.pairs[0].residual_mm > 0')
[ "$rms" = true ] || fail_test "geometry: implausible figures"
check "scene" 0 '"depth_agreement"' measure scene $scene --captures 3 --json
whole=$(measure scene $scene --captures 3 --json 2>/dev/null | number 'o.hole_ratio + o.depth_agreement <= 1 && o.depth_agreement > 0.5 && o.missing_ratio > 0 && o.duplicate_ratio < 0.2 && o.pairs[0].corrected_mm > 0 && o.label_change >= 0 && o.label_change < 1 && o.clipped_ratio >= 0 && o.clipped_ratio < 0.5 && o.outline_px > 0 && o.outline_px < 20 && o.reference')
[ "$whole" = truth ] || fail_test "scene: implausible figures ($whole)"
check "scene of a baseline" 0 '"holoportation"' measure scene $scene --captures 1 --json --pipeline holoportation
check "scene with pictures" 0 "outlines of people" measure scene $scene --captures 2 --pictures outlines
ls outlines/*.png >/dev/null || fail_test "scene: no pictures"
check "scene after one capture" 0 '"label_change": null' measure scene $scene --captures 1 --json
check "scene without a truth" 0 "of one 1 cm grid" measure scene room/untrue.yaml --captures 1
check "scene of points" fails "points" measure scene $scene --captures 1 --set pipeline=points
check "scene elsewhere" fails "." measure scene room/elsewhere.yaml --captures 1
# Photographs: those of the first sensor, as of frame 2 on a scene of frame 0 (somebody has moved in between)
sed 's/last: 2/last: 0/g' $scene >room/first.yaml
poses() { for i in 0 1 2; do echo "$1" >room/pose-$i.txt; done; }
poses "$(grep -m1 -o 'T_world_depth: \[.*\]' $scene | sed 's/.*\[//; s/\]//')"
photos() { measure photos "$@" --pose room/pose-%d.txt; }
check "photos" 0 '"vertex-colors"' photos room/first.yaml --color room/cam-0/color/%06d.png --frames 1,2 --beside vertex-colors --json --pictures pictures
seen=$(photos room/first.yaml --color room/cam-0/color/%06d.png --frames 1,2 --json 2>/dev/null | number 'o.pictures == 2 && o.ssim.mean > 0.5 && o.ssim.mean < 1 && o.psnr_db > 15 && o.covered > 0.5 && o.covered < 1')
[ "$seen" = true ] || fail_test "photos: implausible figures ($seen)"
[ -s pictures/000002.png ] || fail_test "photos: no pictures"
check "photos of a sensor" fails "000000.png.*--frames" photos room/first.yaml --color room/cam-0/color/%06d.png
check "photos by no pattern" fails "color must hold one %d" photos $scene --color room/cam-0/color/000000.png
check "photos: two of one" 2 "measured already" photos $scene --color %d.png --pipeline rgbd --beside rgbd
check "photos without colour" fails "no colour" photos room/colourless.yaml --color %d.png
check "rd" 0 "settings" measure rd $scene --set still.layers=false --csv rd.csv --plot rd.svg --out sweeps --reference monolithic --moments 1 --burst 2 --views 2
[ "$(wc -l <rd.csv)" -gt 48 ] || fail_test "rd: too few settings in rd.csv"
before=$(md5sum sweeps/scene.json)
check "rd, stored already" 0 "settings" measure rd $scene --set still.layers=false --out sweeps --reference monolithic --moments 1 --burst 2 --views 2
[ "$before" = "$(md5sum sweeps/scene.json)" ] || fail_test "rd: measured again what was stored"
grep -q ",1$" rd.csv || fail_test "rd: no setting is on the hull"
grep -q "</svg>" rd.svg || fail_test "rd: no plot"
check "match" 0 '"met": true' measure match $scene --mbps 2000 --json --reference monolithic --moments 1 --burst 2 --pipelines points
cat >still.yaml <<END
scene: still
voxel_m: 0.03
rig: {people: 1, sensors: 2, depth_mode: nfov_binned, color: [320, 180], frames: 20}
fusion: {truncation_m: 0.09, chunk_m: 2.56}
END
check "still" 0 '"wall_rms_mm"' measure still still.yaml --captures 12 --pairs 2 --json --layers true
still=$(measure still still.yaml --captures 12 --pairs 2 --json --set still.layers=false 2>/dev/null | number 'o.layers == false && o.first_s == 0 && o.pairs > 0 && o.changed_ratio > 0 && o.changed_ratio < 1 && o.wall_rms_mm == o.everything.wall_rms_mm && o.hidden_missing < 1')
[ "$still" = true ] || fail_test "still: implausible figures ($still)"
check "features" 0 "" measure features $scene --frames 2 --csv features.csv

# What cannot be measured
for command in ssim compare rd; do
  check "$command without colour" fails "no colour" measure $command room/colourless.yaml
  check "$command without a surface" fails "no |holds no" measure $command room/elsewhere.yaml --reference monolithic
done
check "no viewpoint" fails "viewpoint|surface" measure views room/sliver.yaml --plan none.svg
check "views without a surface" fails "surface|viewpoint" measure views room/elsewhere.yaml
check "geometry without a surface" fails "no surface|empty|surface" measure geometry room/elsewhere.yaml
check "features without colour" fails "colour" measure features room/colourless.yaml --csv none.csv --plot none.svg
check "truth of a real scene" fails "no rig|truth" measure ssim room/untrue.yaml --reference truth
check "still of a real scene" fails "no rig|truth" measure still room/untrue.yaml
check "compare: no folder for the table" fails "no folder" measure compare $scene --csv nowhere/table.csv
check "rd: no folder for the table" fails "no folder" measure rd $scene --csv nowhere/rd.csv
check "match without a target" fails "one of --mbps and --ssim" measure match $scene
check "match for NaN" fails "nan is no number" measure match $scene --mbps nan
check "rd of no views" 2 "" measure rd $scene --views 0
check "rate of one scene" fails "leaving one scene out" measure rate --sweeps sweeps
check "train" 0 "of 1 scenes" "$meshreduce" train --sweeps sweeps --out models.json
mkdir -p none damaged && head -c 300 sweeps/scene.json >damaged/scene.json
check "train without sweeps" fails "holds no sweeps" "$meshreduce" train --sweeps none --out models.json
check "train on a damaged sweep" fails "damaged/scene.json" "$meshreduce" train --sweeps damaged --out models.json
check "views: no folder for the plan" fails "no folder" measure views room/untrue.yaml --plan nowhere/plan.svg
check "match with two targets" fails "excludes" measure match $scene --mbps 3 --ssim 0.5
check "no such scene" fails "missing.yaml" measure ssim missing.yaml
check "no such reference" fails "reference" measure ssim $scene --reference nonsense
printf 'ply\nformat binary_little_endian 1.0\nelement vertex 3\n' >cut.ply
check "cut mesh" fails "cut.ply" measure geometry cut.ply cut.ply
absent room/untrue.views.json none.svg none.csv room/sliver.views.json room/elsewhere.views.json nowhere

finish
