"""RSIPI's echo server on a free port of this computer, until it has taken so many answers.

usage: rsipi_robot.py ETHERNETCONFIG MODE ANSWERS; its last line of output is a JSON object.
"""

import json
import logging
import socket
import sys
import time

ANY = ("0.0.0.0", 50000)  # noqa: S104 (the address it wants, and does not get)
STUCK = 20.0


class LoopbackSocket(socket.socket):
    """The server has no option for its address: all interfaces, port 50000."""

    def bind(self, address):
        super().bind(("127.0.0.1", 0) if address == ANY else address)


def main(config, mode, answers):
    socket.socket = LoopbackSocket
    from RSIPI import rsi_echo_server

    # it logs every packet to a file
    logging.disable(logging.INFO)

    class Counting(rsi_echo_server.EchoServer):
        taken = sent = 0
        heard = time.monotonic()

        def process_reply(self, xml_string):
            accepted = super().process_reply(xml_string)
            if accepted:
                self.taken += 1
                self.heard = time.monotonic()
                if self.taken >= answers:
                    self.running = False
            return accepted

        def send_once(self):
            if self.running:
                self.sent += 1
                super().send_once()

    server = Counting(config, mode=mode, timeout_packets=10 * answers)
    server.start()
    while server.running and time.monotonic() < server.heard + STUCK:
        time.sleep(0.01)
    server.stop()
    result = {"sent": server.sent, "taken": server.taken, "faulty": server.faulty_packets}
    sys.stdout.write("\n" + json.dumps(result | {"pose": server.state["RIst"]}) + "\n")


if __name__ == "__main__":
    main(sys.argv[1], sys.argv[2], int(sys.argv[3]))
