# SPDX-License-Identifier: LGPL-2.1-or-later
"""The foreign subscriber of test_network: decodes what it hears with Python's lcm until it is told to
stop by its standard input, and says of each type how many it has decoded, and of some what is in them."""
import sys
import threading

import arris
import lcm

TYPES = {
    "ROBOT_STATE": arris.robot_state_t, "ROBOT_TRUTH": arris.robot_state_t,
    "ROBOT_COMMAND": arris.robot_command_t, "ROBOT_ACK": arris.robot_ack_t,
    "ARRIS_SEGMENTS": arris.segments_t, "ARRIS_LINES": arris.lines_t,
    "ARRIS_VERDICT": arris.verdict_t, "ARRIS_STATUS": arris.status_t,
    "ARRIS_PREVIEW": arris.preview_t, "ARRIS_IMAGE": arris.image_t,
}
counts, shown = {}, {}


def show(channel, m):
    if channel == "ARRIS_VERDICT":
        return [(f.id, f.deviation, f.at[1][2], f.reason) for f in m.feature] + list(m.extra)
    if channel == "ARRIS_LINES" and m.n:
        return (len(m.cov[0]), len(m.p), m.parts)
    if channel == "ARRIS_IMAGE":
        return (m.width, m.height, len(m.data), m.metadata[0].key)
    return None


def on_message(channel, data):
    m = TYPES[channel].decode(data)
    if m.encode() != data:
        print("differs:", channel, flush=True)
    counts[channel] = counts.get(channel, 0) + 1
    text = show(channel, m)
    if text is not None:
        shown[channel] = text


def main():
    lc = lcm.LCM()
    for channel in TYPES:
        lc.subscribe(channel, on_message).set_queue_capacity(500)
    threading.Thread(target=lambda: (sys.stdin.read(), stop.set()), daemon=True).start()
    print("ready", flush=True)
    while not stop.is_set():
        lc.handle_timeout(100)
    for channel in TYPES:
        print(channel, counts.get(channel, 0), shown.get(channel, ""), flush=True)


stop = threading.Event()
main()
