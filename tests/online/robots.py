"""A controller's end of a socket, played packet by packet, and a settled place to wait at."""

import asyncio
import math
import re
import socket
import time

WAIT = 10.0


class Robot:
    """Sends what it is told from a port of its own and reads the answers."""

    def __init__(self, target):
        self.socket = socket.socket(socket.AF_INET, socket.SOCK_DGRAM)
        self.socket.bind(("127.0.0.1", 0))
        self.socket.settimeout(WAIT)
        self.target = ("127.0.0.1", target[1])

    def send(self, data):
        self.socket.sendto(data, self.target)

    def ask(self, data):
        """The answer to a packet."""
        self.send(data)
        return self.socket.recv(65535)

    def quiet(self):
        """Whether no answer waits, once the link has seen all that was sent."""
        self.socket.settimeout(0.05)
        try:
            return not self.socket.recv(65535)
        except TimeoutError:
            return True
        finally:
            self.socket.settimeout(WAIT)

    def __enter__(self):
        return self

    def __exit__(self, *_):
        self.socket.close()


def rob(ipoc, late=0, x="1000.0000", a1="10.0000"):
    """A packet as the usual configuration has it."""
    return (
        f'<Rob Type="KUKA"><RIst X="{x}" Y="0.0" Z="1500.0" A="90.0" B="0.0" C="0.0" />'
        f'<AIPos A1="{a1}" A2="-90.0" A3="90.0" A4="0.0" A5="45.0" A6="0.0" />'
        f'<Delay D="{late}" /><IPOC>{ipoc}</IPOC></Rob>'
    ).encode()


def ipoc_of(answer):
    return int(re.search(rb"<IPOC>(\d+)</IPOC>", answer)[1])


async def collected(source, count):
    """That many samples of a source, as blocks."""
    blocks, got = [], 0

    async def read():
        nonlocal got
        async for block in source.blocks():
            blocks.append(block)
            got += len(block)
            if got >= count:
                return

    await asyncio.wait_for(read(), WAIT)
    return blocks


def until(condition):
    """Waits until something holds, at most ten seconds."""
    end = time.monotonic() + WAIT
    while not condition():
        assert time.monotonic() < end, "it never came"
        time.sleep(0.001)


def milling_force(time: float) -> tuple[float, ...]:
    """Fx Fy Fz N, Tx Ty Tz N m of a simulated cut: a mean and a line at 60 Hz."""
    tooth = math.sin(2.0 * math.pi * 60.0 * time)
    return (-30.0 - 12.0 * tooth, -5.0 + 40.0 * tooth, 8.0 + 3.0 * tooth, 0.4, -2.0, 0.1)
