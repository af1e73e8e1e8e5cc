#!/usr/bin/env bash
# second_network_test.sh MESHREDUCE: what a gateway prints is opened from another network namespace, and nothing else
# is answered there. Skipped (77) where namespaces cannot be made: that takes root.
set -euo pipefail
program=$1
folder=$(mktemp -d)
name=mr-other-$$
skip() { echo "skipped: $1"; exit 77; }
clean_up() {
  [ -z "${pid:-}" ] || kill "$pid" 2>/dev/null || true
  ip netns del "$name" 2>/dev/null || true
  rm -rf "$folder"
}
trap clean_up EXIT

command -v ip >/dev/null || skip "no ip (iproute2)"
ip netns add "$name" 2>/dev/null || skip "no right to make a network namespace"
ip link add mrt0-$$ type veth peer name mrt1-$$ 2>/dev/null || skip "no virtual links"
ip link set mrt1-$$ netns "$name"
ip addr add 10.213.77.1/24 dev mrt0-$$ && ip link set mrt0-$$ up
ip -n "$name" addr add 10.213.77.2/24 dev mrt1-$$ && ip -n "$name" link set mrt1-$$ up

cat >"$folder/scene.yaml" <<'YAML'
scene: far
up: [0, 0, 1]
voxel_m: 0.05
nats: {url: "nats://127.0.0.1:1"}   # the root is elsewhere: the page is served all the same
gateway: {listen: "0.0.0.0:0", open: true}
rig: {type: synthetic, seed: 1, room: [4, 4, 2.5], color: [320, 180], depth_mode: nfov_binned, sensors: 1, frames: 1}
YAML
mkdir "$folder/page"
echo "the page" >"$folder/page/index.html"
"$program" node "$folder/scene.yaml" gateway --page "$folder/page" >"$folder/out" 2>"$folder/log" &
pid=$!
for _ in $(seq 200); do grep -q '^Open ' "$folder/out" && break; sleep 0.05; done
urls=$(grep -o 'http://[^ ]*' "$folder/out") || { cat "$folder/log"; exit 1; }

# ask URL HOST: the status line and body that the other namespace gets, with bash alone.
ask() {
  local address=${1#http://}
  ip netns exec "$name" timeout 5 bash -c "exec 3<>/dev/tcp/${address%:*}/${address##*:} &&
    printf 'GET / HTTP/1.1\r\nHost: %s\r\nConnection: close\r\n\r\n' '$2' >&3 && cat <&3" 2>&1 || echo "(no answer)"
}
printed=$(grep '//10\.213\.77\.1:' <<<"$urls") || { echo "not printed: 10.213.77.1, only $urls"; exit 1; }
grep -q 'the page' <<<"$(ask "$printed" "${printed#http://}")" || { echo "$printed cannot be opened from there"; exit 1; }
grep -q '^HTTP/1.1 421' <<<"$(ask "$printed" evil.example)" || { echo "another host's name is answered"; exit 1; }
for url in $urls; do  # each one is answered for, as this machine sees it
  address=${url#http://}
  timeout 5 bash -c "exec 3<>/dev/tcp/${address%:*}/${address##*:} &&
    printf 'GET / HTTP/1.1\r\nHost: $address\r\nConnection: close\r\n\r\n' >&3 && cat <&3" | grep -q 'the page' ||
    { echo "$url is printed and does not answer"; exit 1; }
done
echo "opened from another network: $printed"
