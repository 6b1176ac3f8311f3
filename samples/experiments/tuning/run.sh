#!/bin/sh
# SPDX-License-Identifier: LGPL-2.1-or-later
#
# The thesis's section 3.4: its two sets of tol, angtol and linkrad on the box, with its own
# segments and with the refitted ones. Prints the table and draws a figure; `make experiments` runs
# it. B is the build's folder.
set -eu
root=$(cd "$(dirname "$0")/../../.." && pwd)
B=$(cd "${B:-$root/build}" && pwd)
out=$B/experiments/tuning
export ARRIS_PLUGIN_PATH="$B/experiments"
mkdir -p "$out"

try() { # MODE TOL ANGTOL LINKRAD FIGURE LABEL
    "$B/arris" launch imagesrc "location=$root/samples/experiments/data/box/frames.csv" ! edges ! undistort \
        ! segments "mode=$1" "tol=$2" "angtol=$3" "linkrad=$4" ! track ! reconstruct \
        ! tuning "truth=$root/samples/experiments/data/box/truth.csv" "figure=$out/$5.svg" \
        "label=$6"
}

echo "A frame's segments, their mean length in px, those on the box's eight visible edges, the share of"
echo "these edges' length that they cover, and how far they lie off it (RMS, px). Then the whole chain:"
echo "lines on these edges, edges that have one (four run along the motion, and have none), and the"
echo "median depth error in mm. The poses are the true ones, so that the robot's jitter hides nothing."
echo
echo "tol, angtol, linkrad           segments   length  on edges  share %  off     lines edges  error"
try thesis 2 0.05 2 1 "thesis 1: 2, 0.05, 2"
try thesis 6 0.2 6 2 "thesis 2: 6, 0.2, 6"
try refit 2 0.05 2 3 "refit 1: 2, 0.05, 2"
try refit 6 0.2 6 4 "refit 2: 6, 0.2, 6"

# The two sets in the thesis's mode, beside each other.
{
    echo '<svg xmlns="http://www.w3.org/2000/svg" width="1312" height="526">'
    cat "$out/1.svg"
    echo '<g transform="translate(656 0)">'
    cat "$out/2.svg"
    echo '</g></svg>'
} > "$out/tuning.svg"
rm "$out"/[1-4].svg
echo "figure: $out/tuning.svg"
