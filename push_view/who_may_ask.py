"""Which requests the page's server answers: only those of its own page.

Any web page can make its visitor's browser send requests to this server, and can make its own name
resolve to this machine (DNS rebinding). Therefore the Host header of a request must be an address
under which the server is really reached, and the request must not come from another origin:

- ``localhost``, the host that the server was told to bind, and addresses written as numbers
  (``127.0.0.1``, ``192.168.1.7``, ``[::1]``) are accepted, because a foreign name cannot be one.
  A server bound to one address accepts only that one and the loopback's.
- A server bound to all addresses (``0.0.0.0``, ``::``) accepts every numeric address, the host name
  of the machine, and that name with ``.local``, under which the local network finds it (multicast
  DNS, RFC 6762; a name server outside cannot give it an address). It accepts no other name.
- The port is ignored, because a tunnel may forward another one.
- ``Origin``, if a browser sends it, must be that host and port. ``Sec-Fetch-Site`` must not name
  another site, except for the page itself, to which anybody may link.
- A request that moves a robot must also have the content type JSON, which other sites cannot send
  without a preflight request.
"""

import ipaddress
import socket
from collections.abc import Sequence
from dataclasses import dataclass
from email.message import Message

EVERYWHERE = ("", "0.0.0.0", "::")
"""Hosts that stand for all addresses of this machine."""

_LOOPBACK = frozenset({"localhost", "127.0.0.1", "::1"})


def host_name(text: str) -> str:
    """The host in a Host header, in lower case, without port and brackets; empty for nonsense."""
    text = text.strip().lower()
    if text.startswith("["):
        name, bracket, rest = text[1:].partition("]")
        good = bracket and (not rest or (rest[0] == ":" and rest[1:].isdigit()))
    else:
        name, colon, port = text.partition(":")
        good = not colon or port.isdigit()
    return name.rstrip(".") if good else ""


def _is_address(name: str) -> bool:
    try:
        ipaddress.ip_address(name)
    except ValueError:
        return False
    return True


@dataclass(frozen=True)
class WhoMayAsk:
    """The rule for a server bound to a host; own_name: of the machine."""

    bound: str
    own_name: str

    @property
    def everywhere(self) -> bool:
        """Whether it is bound to all addresses."""
        return self.bound in EVERYWHERE

    def knows(self, host: str) -> bool:
        """Whether a Host header names an address under which the server is reached."""
        name = host_name(host)
        if not name:
            return False
        if self.everywhere:
            own = self.own_name.lower().removesuffix(".local")
            return name in (*_LOOPBACK, own, f"{own}.local") or _is_address(name)
        return name in (*_LOOPBACK, self.bound.lower().strip("[]"))

    def refusal(self, headers: Message, *, page: bool = False, acts: bool = False) -> str:
        """Why a request is refused; empty if it is answered.

        page: it asks for the page itself. acts: it would move a robot.
        """
        hosts: Sequence[str] = headers.get_all("Host") or []
        if len(hosts) != 1 or not self.knows(hosts[0]):
            return f"this server does not go by the name {' and '.join(hosts) or '(none)'}"
        origins = headers.get_all("Origin") or []
        if any(origin.lower() != f"http://{hosts[0].lower()}" for origin in origins):
            return "only from the page itself, not from another site's"
        site = headers.get("Sec-Fetch-Site", "same-origin")
        if not page and site not in ("same-origin", "none"):
            return "only from the page itself, not from another site's"
        if acts and headers.get("Content-Type") != "application/json":
            return "only from the page itself: expected Content-Type application/json"
        return ""


def who_may_ask(bound: str) -> WhoMayAsk:
    """The rule for a server that this machine binds to a host."""
    return WhoMayAsk(bound, socket.gethostname())
