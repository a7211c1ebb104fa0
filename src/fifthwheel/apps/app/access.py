"""Who may use the server: checks of every request and of every websocket, before it reaches a page."""

import hmac
import re
import secrets
from collections.abc import Mapping
from dataclasses import dataclass, field
from http.cookies import CookieError, SimpleCookie
from typing import Any
from urllib.parse import parse_qs, quote

from fifthwheel.apps.addresses import is_address, is_loopback

POLICY = "; ".join(
    (
        "default-src 'none'",
        "script-src 'self' 'unsafe-inline' 'unsafe-eval'",  # the page has templates that are compiled in the browser
        "style-src 'self' 'unsafe-inline'",
        "img-src 'self' data: blob:",
        "font-src 'self' data:",
        "connect-src 'self'",
        "frame-src 'self'",
        "form-action 'self'",
        "base-uri 'none'",
        "frame-ancestors 'self'",
    )
)
"""What a page may load: nothing from elsewhere."""
HEADERS = (
    (b"content-security-policy", POLICY.encode()),
    (b"cross-origin-opener-policy", b"same-origin"),
    (b"cross-origin-resource-policy", b"same-origin"),
    (b"referrer-policy", b"no-referrer"),
    (b"x-content-type-options", b"nosniff"),
)
"""Of every answer."""
MAX_BODY = 1_000_000
"""Bytes of a request that is not a dropped file."""
MAX_FILE = 8_000_000_000
"""Bytes of a dropped file."""
_UPLOAD = re.compile(r"/_nicegui/client/[^/]+/upload/[0-9]+")


@dataclass(frozen=True, kw_only=True)
class Access:
    """What a request needs.

    Each start has a secret. A page sets it as a cookie that a browser sends with requests of the same site only;
    without it, nothing but a page is answered. So the page of another site can neither change nor read anything.
    """

    local: bool = True
    """Whether only this computer may ask."""
    token: str | None = None
    """Needed once in each browser, as ?token=...; None: not needed."""
    port: int = 0
    """Part of the name of the cookie, because browsers share cookies between ports."""
    max_file: int = MAX_FILE
    secret: str = field(default_factory=secrets.token_urlsafe, repr=False)

    @property
    def cookie(self) -> str:
        return f"fifthwheel_{self.port}"

    def refusal(self, scope: Mapping[str, Any]) -> tuple[int, str] | None:
        """Status and reason if a request is refused; None if it may pass."""
        headers = _headers(scope)
        host = headers.get("host", "")
        if not (is_loopback(host) if self.local else is_address(host)):
            return 421, "Use the address of the computer, such as 127.0.0.1."
        origin = headers.get("origin")
        if origin is not None and origin.partition("://")[2] != host:
            return 403, "The request comes from another site."
        site, mode = headers.get("sec-fetch-site", "none"), headers.get("sec-fetch-mode")
        opens = scope["type"] == "http" and scope["method"] in ("GET", "HEAD")
        if site not in ("none", "same-origin") and not (opens and mode == "navigate"):
            return 403, "The request comes from another site."
        if not self.known(headers) and not (opens and (self.token is None or self.has_token(scope))):
            return 401, "Open the address that fifthwheel app has printed."
        if int(headers.get("content-length", "0") or 0) > self.limit(scope):
            return 413, f"Larger than {self.limit(scope) / 1e6:.0f} MB."
        return None

    def limit(self, scope: Mapping[str, Any]) -> int:
        """Bytes that the body of a request may have."""
        return self.max_file if _UPLOAD.fullmatch(scope["path"]) else MAX_BODY

    def known(self, headers: Mapping[str, str]) -> bool:
        """Whether the browser has the cookie of this start."""
        try:
            cookies = SimpleCookie(headers.get("cookie", ""))
        except CookieError:
            return False
        return self.cookie in cookies and _same(cookies[self.cookie].value, self.secret)

    def has_token(self, scope: Mapping[str, Any]) -> bool:
        """Whether the address has the right token."""
        given = parse_qs(scope.get("query_string", b"").decode("latin-1")).get("token", [""])[0]
        return self.token is not None and _same(given, self.token)


class Guard:
    """Middleware that lets through what `Access` permits, and adds headers to the answers."""

    def __init__(self, app: Any, access: Access) -> None:
        self.app, self._access = app, access

    async def __call__(self, scope: Any, receive: Any, send: Any) -> None:
        """Check a request; see the ASGI specification."""
        if scope["type"] == "lifespan":
            await self.app(scope, receive, send)
            return
        access = self._access
        refusal = _malformed(scope) or access.refusal(scope)
        if refusal is not None:
            await _refuse(scope, send, *refusal)
            return
        new = scope["type"] == "http" and not access.known(_headers(scope))
        headers = [*HEADERS]
        if new:
            value = f"{access.cookie}={access.secret}; Path=/; HttpOnly; SameSite=Strict"
            headers.append((b"set-cookie", value.encode()))
        if new and access.token is not None:  # the token leaves the address bar
            place = f"/{quote(scope['path'].lstrip('/'))}".encode()  # //x would be another host
            location = [(b"location", place), (b"content-length", b"0")]
            await send({"type": "http.response.start", "status": 303, "headers": [*headers, *location]})
            await send({"type": "http.response.body"})
            return
        left = access.limit(scope)

        async def limited() -> Any:
            nonlocal left
            message = await receive()
            left -= len(message.get("body", b"")) if message["type"] == "http.request" else 0
            return message if left >= 0 else {"type": "http.disconnect"}

        async def extended(message: Any) -> None:
            if message["type"] == "http.response.start":
                message = message | {"headers": [*message.get("headers", []), *headers]}
            await send(message)

        await self.app(scope, limited, extended)


def _malformed(scope: Mapping[str, Any]) -> tuple[int, str] | None:
    """Refuse headers that are repeated or not numbers where one number is expected."""
    names = [name.lower() for name, _ in scope["headers"]]
    length = _headers(scope).get("content-length", "0")
    if any(names.count(name) > 1 for name in (b"host", b"origin", b"content-length")) or not length.isdecimal():
        return 400, "A header is repeated or malformed."
    return None


async def _refuse(scope: Mapping[str, Any], send: Any, status: int, reason: str) -> None:
    if scope["type"] == "websocket":
        await send({"type": "websocket.close", "code": 1008, "reason": reason})
        return
    body = f"{reason}\n".encode()
    headers = [(b"content-type", b"text/plain; charset=utf-8"), (b"content-length", b"%d" % len(body))]
    await send({"type": "http.response.start", "status": status, "headers": [*headers, *HEADERS]})
    await send({"type": "http.response.body", "body": body})


def _headers(scope: Mapping[str, Any]) -> dict[str, str]:
    return {name.decode("latin-1").lower(): value.decode("latin-1") for name, value in scope["headers"]}


def _same(given: str, expected: str) -> bool:
    return hmac.compare_digest(given.encode(), expected.encode())
