#!/usr/bin/env python3
# SPDX-License-Identifier: LGPL-2.1-or-later
"""Listens to the lines that a pipeline with lcmsink tells of, and keeps them. It ends with the scan,
and prints what was measured.

    pip install lcm==1.5.3; make lcmtypes-python
    PYTHONPATH=build/python samples/subscriber/subscriber.py
"""
import arris
import lcm

lines = {}
ended = False


def on_lines(_channel, data):
    global ended
    m = arris.lines_t.decode(data)
    if m.kind != m.CHANGES and m.part == 0:
        lines.clear()  # what is in none of the parts is gone
    for i in range(m.n):
        if m.change[i] in (m.MERGED, m.RETIRED):
            lines.pop(m.id[i], None)
        else:
            lines[m.id[i]] = (m.state[i], m.p[i], m.q[i])
    last = m.part + 1 == m.parts
    if m.kind == m.WHOLE and last:
        print(f"frame {m.frame}: {len(lines)} lines", flush=True)
    ended = m.kind == m.FINAL and last


lc = lcm.LCM()  # LCM_DEFAULT_URL, or multicast on this machine
lc.subscribe("ARRIS_LINES", on_lines)
while not ended:
    lc.handle()
for number, (state, p, q) in lines.items():
    if state == arris.lines_t.MEASURED:
        print(f"{number:4d}  " + "   ".join(" ".join(f"{v:8.2f}" for v in end) for end in (p, q)))
