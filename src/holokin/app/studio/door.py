"""`Door`: who may come in to a page that is served, told by the host, the origin and the path of a request.

A browser sends what any page in it asks for to any address, also to one of this machine. So a request must name the
studio's own host (else a name that an attacker points here would do: DNS rebinding), must not come from a page of
another origin, and must know a token that only the printed address has.
"""

from __future__ import annotations

import hmac
import ipaddress
import secrets
import socket
from collections.abc import Sequence

BYTES = 24  # of a token: 192 bits, which nobody guesses
HERE = "127.0.0.1"  # this machine alone
LOOPBACK = frozenset({"localhost", "127.0.0.1", "[::1]"})  # names by which a browser of this machine calls it

PAGE = (
    ("Referrer-Policy", "no-referrer"),  # the address has the token in it: no link may carry it out
    ("Cache-Control", "no-store"),  # nor the disk keep it
    ("X-Frame-Options", "DENY"),  # no page lays the studio under its own buttons
    ("X-Content-Type-Options", "nosniff"),
    ("Cross-Origin-Opener-Policy", "same-origin"),
    ("Cross-Origin-Resource-Policy", "same-origin"),
)
"""Headers of all answers."""

HOST = "This is not a name of the studio. Open the address that it printed when it was started."
ORIGIN = "Only the studio's own page may ask for this."
TOKEN = "This address has no token, or an old one. Open the address that the studio printed when it was started."


class Door:
    """Lets in who calls the studio by its own name, comes from no other page, and knows its token.

    Attributes:
        token: the first part of the path of the page and of all that it asks for. A path is no cookie: browsers send
            cookies to all ports of a host, and so to servers of other users.
    """

    def __init__(self, host: str) -> None:
        self.token = secrets.token_urlsafe(BYTES)
        self._names, self._any_address = _own_names(host), wildcard(host)

    def stranger(self, port: int, hosts: Sequence[str], origins: Sequence[str]) -> str:
        """Why a request is not one of the studio's own page, in a sentence; empty if it may be.

        Args:
            port: at which it came. hosts, origins: all values of its headers of these names.
        """
        if len(hosts) != 1 or not self._known(hosts[0].lower(), port):
            return HOST
        if any(origin.lower() != f"http://{hosts[0].lower()}" for origin in origins):
            return ORIGIN
        return ""

    def knows(self, path: str) -> bool:
        """Whether a path begins with the token."""
        given = path.partition("?")[0].split("/")[1:2]
        return bool(given) and same(given[0], self.token)

    def _known(self, host: str, port: int) -> bool:
        """Whether a Host header (name:port, in small letters) names the studio."""
        name, colon, port_text = host.rpartition(":") if not host.endswith("]") else (host, "", "")
        if not colon:
            name, port_text = host, "80"  # what browsers leave out
        if port_text != str(port):
            return False
        # The address of a machine is a name of it, too, where all are served: nobody can point it elsewhere.
        address = _address(name.removeprefix("[").removesuffix("]")) if self._any_address else None
        return name in self._names or (address is not None and not address.is_unspecified)


def same(given: str, known: str) -> bool:
    """Whether two texts are one, in a time that does not tell how much of them is."""
    return hmac.compare_digest(given.encode("utf-8", "replace"), known.encode())


def inner(path: str) -> str:
    """A path without its first part, the token."""
    place, mark, query = path.partition("?")
    return f"/{'/'.join(place.split('/')[2:])}{mark}{query}"


def policy(host: str) -> str:
    """What the page may load (Content-Security-Policy): what its own server gives, and what it makes itself.

    viser's page is one file that unpacks itself, so its own scripts are allowed. Above all its `?websocket=` cannot
    join it to another server, and no page may frame it.
    """
    own = "'self' 'unsafe-inline' 'unsafe-eval' blob: data:"
    return (
        f"default-src {own}; connect-src 'self' ws://{host} blob: data:; object-src 'none'; base-uri 'none'; "
        "form-action 'none'; frame-ancestors 'none'"
    )


def _own_names(host: str) -> frozenset[str]:
    """The names, in small letters, by which browsers call a server at an address of this machine."""
    name = (f"[{host}]" if ":" in host else host).lower()
    if loopback(host):
        return LOOPBACK | {name}
    machine = socket.gethostname().lower()
    others = {machine, f"{machine}.local"} if machine else set[str]()
    return frozenset(others | LOOPBACK) if wildcard(host) else frozenset(others | {name})


def _address(text: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    """The IP address that a text is; None of a name."""
    try:
        return ipaddress.ip_address(text)
    except ValueError:
        return None


def loopback(host: str) -> bool:
    """Whether an address is reached from this machine alone."""
    address = _address(host)
    return host.lower() == "localhost" if address is None else address.is_loopback


def wildcard(host: str) -> bool:
    """Whether an address stands for all of this machine's."""
    address = _address(host)
    return host == "" if address is None else address.is_unspecified
