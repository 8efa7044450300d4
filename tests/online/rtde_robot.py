"""A robot that speaks RTDE: started by a test with its address, ends after 30 s or when killed."""

import socket
import struct
import sys
import time

from robotrue.online import rtde
from robotrue.online.device_defaults import RTDE_PORT

VALUES = {
    "timestamp": ("DOUBLE", (0.0,)),
    "actual_q": ("VECTOR6D", (0.1, -1.5, 1.5, 0.0, 0.5, 3.0)),
    "actual_TCP_pose": ("VECTOR6D", (0.5, 0.1, 0.2, 0.0, 0.0, 1.0)),
    "robot_status_bits": ("UINT32", (1,)),
    "safety_status_bits": ("UINT32", (1,)),
    "runtime_state": ("UINT32", (1,)),
    "robot_mode": ("INT32", (7,)),
    "safety_mode": ("INT32", (1,)),
}


def recipe_of(frame):
    """A client may ask for more than it was told to, and end its list with a comma."""
    names = tuple(name for name in frame.payload[8:].decode().split(",") if name)
    return rtde.Recipe(number=1, names=names, types=tuple(VALUES[name][0] for name in names))


def answer(frame):
    if frame.kind == "v":
        return rtde.write_frame("v", struct.pack(">4I", 5, 12, 4, 1))
    if frame.kind == "O":
        return rtde.write_recipe("O", recipe_of(frame))
    return rtde.write_frame(frame.kind, b"\x01")


def serve(link, until):
    link.settimeout(0.002)
    buffer, tick, started, recipe = b"", 0, False, None
    while time.monotonic() < until:
        try:
            buffer += link.recv(4096)
        except TimeoutError:
            pass
        frames, buffer = rtde.split_frames(buffer)
        for frame in frames:
            started = started or frame.kind == "S"
            recipe = recipe_of(frame) if frame.kind == "O" else recipe
            link.sendall(answer(frame))
        if started:
            tick += 1
            values = {name: value for name, (_, value) in VALUES.items()}
            values["timestamp"] = (tick / 500.0,)
            link.sendall(rtde.write_data(recipe, values))


def main():
    with socket.socket(socket.AF_INET, socket.SOCK_STREAM) as server:
        server.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        server.bind((sys.argv[1], RTDE_PORT))
        server.listen(1)
        server.settimeout(30.0)
        sys.stdout.write("ready\n")
        sys.stdout.flush()
        link, _ = server.accept()
        with link:
            serve(link, time.monotonic() + 30.0)


if __name__ == "__main__":
    main()
