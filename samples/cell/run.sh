#!/usr/bin/env bash
# SPDX-License-Identifier: LGPL-2.1-or-later
#
# run.sh [SECONDS]: a robot cell as processes that know each other by LCM only: robot, camera, pipeline,
# subscribers, in a network of their own. The robot goes home and sweeps, the lines appear while it
# moves. Then what was recorded is measured again, offline, to the same lines.
set -euo pipefail
cd "$(dirname "$0")/../.."
B=${B:-build}
seconds=${1:-60}
export LCM_DEFAULT_URL='udpm://239.255.76.67:7667?ttl=0&recv_buf_size=4194304'

if [ -z "${ARRIS_CELL:-}" ]; then
    as_root=; [ "$(id -u)" = 0 ] || as_root=-r
    ARRIS_CELL=1 exec unshare $as_root -n "$0" "$seconds"
fi
ip link set lo up multicast on
ip route add 224.0.0.0/4 dev lo
[ "$(cat /proc/sys/net/core/rmem_max 2>/dev/null || echo 4194304)" -ge 4194304 ] ||
    echo "net.core.rmem_max is below 4194304: pictures may get lost; as root: sysctl -w net.core.rmem_max=4194304"

out=$B/cell
rm -rf "$out"
mkdir -p "$out"
trap 'kill $(jobs -p) 2>/dev/null || true' EXIT
chain=(edges ! undistort ! segments ! track ! reconstruct)
camera=samples/cell/camera.json
patience=$((seconds + 60))

"$B/arris-robot" --driver sim --rate "${CELL_RATE:-200}" --home=-270,-40,0 --space=-300,300,-100,100,-50,50 & robot=$!
"$B/arris-robot" --speed 100 home
lcm-logger --quiet --channel='ARRIS_IMAGE|ROBOT_STATE' "$out/run.lcmlog" & logger=$!
timeout $patience "$B/cell-watch" > "$out/watch.txt" & watch=$!
timeout $patience "$B/subscriber" > "$out/subscriber.txt" & subscriber=$!
python=
if [ -e "$B/venv/lcm" ]; then
    PYTHONPATH=$B/python timeout $patience "$B/venv/bin/python3" samples/subscriber/subscriber.py \
        > "$out/python.txt" & python=$!
fi
"$B/arris" launch --stats lcmsrc camera=$camera format=grey8 ! queue leaky=oldest max-frames=8 \
    ! pose wait=500 ! "${chain[@]}" ! tee name=t \
    t. ! lcmsink preview=5 segments=10 t. ! filesink location="$out/lines.json" > "$out/stats.txt" & pipeline=$!
sleep 0.5
for _ in {1..200}; do # the states that the logger writes say that it is there
    [ -s "$out/run.lcmlog" ] && break
    sleep 0.05
done
"$B/arris" launch --stats scenesrc location=samples/cell/box.obj camera=$camera robot=default fps="${CELL_FPS:-30}" \
    ! queue leaky=oldest max-frames=8 ! lcmsink images=every status=0 > "$out/camera.txt" & eye=$!

end=$((SECONDS + seconds))
while [ $SECONDS -lt $end ]; do
    "$B/arris-robot" --speed 50 path samples/cell/sweep.csv & sweep=$!
    while kill -0 $sweep 2>/dev/null && [ $SECONDS -lt $end ]; do sleep 0.2; done
    kill -INT $sweep 2>/dev/null || true
    wait $sweep || [ $SECONDS -ge $end ]
done

kill -INT $eye; wait $eye
sleep 0.5
kill -INT $pipeline; wait $pipeline
wait $subscriber $python
result=0
wait $watch || result=1
kill $logger; wait $logger || true
kill $robot; wait $robot

if [ -n "$python" ] && ! cmp -s <(grep -v ^frame "$out/subscriber.txt") <(grep -v ^frame "$out/python.txt"); then
    echo "the subscribers in C and in Python do not agree: $out/subscriber.txt, $out/python.txt"
    result=1
fi
grep '^frame' "$out/subscriber.txt" | sed -n '1~5p'
cat "$out/watch.txt"
"$B/arris" launch --stats lcmsrc url="file://$out/run.lcmlog" camera=$camera ! pose url="file://$out/run.lcmlog" \
    ! "${chain[@]}" ! filesink location="$out/offline.json" > "$out/offline.txt"
if cmp -s "$out/lines.json" "$out/offline.json"; then
    echo "offline   the same lines, to the last digit, from what was recorded"
else
    echo "offline   other lines than live: $out/lines.json, $out/offline.json"
    ! grep -Eq '^(lcmsrc .*missing|pose .*without pose)' "$out/offline.txt" ||
        echo "          messages are missing in what was recorded, of which lcm-logger queues 30: $out/offline.txt"
    result=1
fi
rm -f "$out/run.lcmlog"
exit $result
