"""RSIPI's echo server on a free port of this computer, until it has taken so many answers.

usage: rsipi_robot.py ETHERNETCONFIG MODE ANSWERS [first]; its last line of output is a JSON object.
With ``first`` it asks to run before other programs: a controller's cycle waits for nobody.
"""

import json
import logging
import os
import socket
import sys
import time

ANY = ("0.0.0.0", 50000)  # noqa: S104 (the address it wants, and does not get)
STUCK = 20.0


class LoopbackSocket(socket.socket):
    """The server has no option for its address: all interfaces, port 50000."""

    def bind(self, address):
        super().bind(("127.0.0.1", 0) if address == ANY else address)


def first():
    """Whether it runs before other programs from now on."""
    try:
        os.sched_setscheduler(0, os.SCHED_RR, os.sched_param(1))
    except OSError:
        return False
    return True


def main(config, mode, answers, *, preferred=False):
    socket.socket = LoopbackSocket
    from RSIPI import rsi_echo_server

    # it logs every packet to a file
    logging.disable(logging.INFO)

    class Counting(rsi_echo_server.EchoServer):
        taken = sent = 0
        heard = time.monotonic()
        missed = ()
        answered = None

        def process_reply(self, xml_string):
            accepted = super().process_reply(xml_string)
            if accepted:
                self.taken += 1
                self.answered = self.last_sent_ipoc
                self.heard = time.monotonic()
                if self.taken >= answers:
                    self.running = False
            return accepted

        def send_once(self):
            if self.running:
                if self.taken and self.answered != self.last_sent_ipoc:
                    self.missed += (self.last_sent_ipoc,)
                self.sent += 1
                super().send_once()

    server = Counting(config, mode=mode, timeout_packets=10 * answers)
    server.start()
    while server.running and time.monotonic() < server.heard + STUCK:
        time.sleep(0.01)
    server.stop()
    result = {"sent": server.sent, "taken": server.taken, "faulty": server.faulty_packets}
    result |= {"missed": server.missed, "preferred": preferred, "pose": server.state["RIst"]}
    sys.stdout.write("\n" + json.dumps(result) + "\n")


if __name__ == "__main__":
    main(*sys.argv[1:3], int(sys.argv[3]), preferred=sys.argv[4:] == ["first"] and first())
