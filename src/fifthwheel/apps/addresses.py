"""Addresses of computers in the header Host of a request.

A page of another site can reach a server on this computer by a name that it points here (DNS rebinding). The header
Host then has that name; a server of this package therefore accepts only addresses and localhost there.
"""

import ipaddress
from urllib.parse import urlsplit


def is_address(host: str) -> bool:
    """Whether a header Host, such as "127.0.0.1:8080", names a computer by an address, or as localhost."""
    return _address(host) is not None


def is_loopback(host: str) -> bool:
    """Whether a header Host names this computer, by an address that no other computer can reach."""
    address = _address(host)
    return address is not None and address.is_loopback


def _address(host: str) -> ipaddress.IPv4Address | ipaddress.IPv6Address | None:
    try:
        name = urlsplit(f"//{host}").hostname or ""
        return ipaddress.ip_address("127.0.0.1" if name == "localhost" else name)
    except ValueError:
        return None
