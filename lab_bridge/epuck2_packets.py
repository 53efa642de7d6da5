"""Packets of an e-puck2 over TCP, after the maker's description (GCtronic, "e-puck2 PC side
development", section "WiFi" of the communication protocol). All numbers are little-endian.

The robot is the server. A command has 21 bytes: the identifier 0x80; what is asked for; settings;
speeds of the left and the right motor as 16-bit numbers; and LEDs and sound in 14 bytes. Every
answer begins with an identifier: 0x01, an image; 0x02, the sensors; 0x03, nothing more, the
acknowledgement of a command that asks for nothing.
"""

import struct

COMMAND = 0x80
IMAGE, SENSORS, EMPTY = 0x01, 0x02, 0x03
LENGTHS = {IMAGE: 160 * 120 * 2, SENSORS: 104, EMPTY: 0}
"""[bytes] of an answer after its identifier."""

_FORMAT = struct.Struct("<BBBhhB12sB")
COMMAND_LENGTH = _FORMAT.size
"""[bytes] of a command: 21."""


class BadPacket(ValueError):
    """Raised for bytes that are no packet."""


def encode(left: int, right: int) -> bytes:
    """The command that sets the speeds of the motors [steps/s], asks for nothing, LEDs off."""
    return _FORMAT.pack(COMMAND, 0, 0, left, right, 0, bytes(12), 0)


def decode(packet: bytes) -> tuple[int, int]:
    """Speeds of the left and the right motor [steps/s] of a command.

    Raises
    ------
    BadPacket: it is no command of motor speeds.
    """
    if len(packet) != COMMAND_LENGTH or packet[0] != COMMAND:
        raise BadPacket(f"{len(packet)} bytes that begin with {packet[:1].hex()}: no command")
    _, _, modes, left, right, *_ = _FORMAT.unpack(packet)
    if modes & 0x04:
        raise BadPacket("motor positions are commanded, not speeds")
    return int(left), int(right)


class AnswerReader:
    """Counts the answers in a stream of bytes that arrives in pieces of any length."""

    def __init__(self) -> None:
        self._left = 0  # bytes of the answer that is arriving

    def feed(self, data: bytes) -> int:
        """How many answers end in these bytes.

        Raises
        ------
        BadPacket: an answer has an unknown identifier, so it is not known where the next begins.
        """
        ended, at = 0, 0
        while at < len(data):
            if self._left == 0:
                identifier = data[at]
                at += 1
                if identifier not in LENGTHS:
                    raise BadPacket(f"an answer begins with 0x{identifier:02x}")
                self._left = LENGTHS[identifier]
            else:
                step = min(self._left, len(data) - at)
                self._left -= step
                at += step
            ended += self._left == 0
        return ended
