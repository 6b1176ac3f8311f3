#!/bin/sh
# SPDX-License-Identifier: LGPL-2.1-or-later
#
# The thesis's section 2.3: edges, corners and optical flow side by side, on the box and on a hull
# section, for a small and a large motion between two frames. Prints the table and draws a figure
# for each; `make experiments` runs it. B is the build's folder. The pictures (path-traced), poses and
# true edges are our own and under the licence of this project.
set -eu
root=$(cd "$(dirname "$0")/../../.." && pwd)
B=$(cd "${B:-$root/build}" && pwd)
out=$B/experiments/features
data=$root/samples/experiments/data
export ARRIS_PLUGIN_PATH="$B/experiments"
mkdir -p "$out"

scene() { # NAME MOTION RANGE LABEL
    "$B/arris" launch imagesrc "location=$data/$1/$2.csv" ! edges ! corners max=2000 \
        ! flow "range=$3" ! features "truth=$data/$1/truth.csv" "figure=$out/$1-$2.svg" "label=$4"
}

echo "How much of the true edges' length a feature describes (an edge along it, a corner at it, a step"
echo "of the flow across it); how much of that is found again in the second frame, within 1 px of where"
echo "the true poses put it; both together, and the median error of what was found again."
echo
echo "scene, motion            method   features   described %   found again %   both %   error / px"
scene box small 4 "box, 2 px"
scene box large 25 "box, 19 px"
scene ship small 3 "ship, 1.5 px"
scene ship large 20 "ship, 13 px"

# Microseconds a frame of a stage, from the table of --stats; the median, so that a busy machine
# matters little.
echo
"$B/arris" launch --stats imagesrc "location=$root/samples/box/frames.csv" ! edges ! corners ! flow \
    ! fakesink 2>&1 | awk '
    $1 ~ /^(edges|corners|flow)$/ { time[$1] = $5 }
    END { if (!time["edges"]) exit 1
          printf "time a frame, that of edges being 1: corners %.1f, flow %.0f\n",
                 time["corners"] / time["edges"], time["flow"] / time["edges"] }'
echo "figures: $out/*.svg"
