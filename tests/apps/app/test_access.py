"""Who may use the server, without a browser: the rules on every request, around an application that answers all."""

import asyncio
from types import SimpleNamespace
from urllib.parse import urlsplit

from fifthwheel.apps.app.access import MAX_BODY, Access, Guard

UPLOAD = "/_nicegui/client/abc/upload/7"
LOCAL = "http://127.0.0.1:8080"
HOST = {"host": "127.0.0.1:8080"}


async def _inner(scope, receive, send):
    """Counts the bytes of the body; None where the connection was ended."""
    size, more = 0, scope["type"] == "http"
    while more:
        message = await receive()
        if message["type"] == "http.disconnect":
            size = None
            break
        size, more = size + len(message["body"]), message["more_body"]
    await send({"type": f"{scope['type']}.{'response.start' if scope['type'] == 'http' else 'accept'}", "status": 200})
    await send({"type": f"{scope['type']}.{'response.body' if scope['type'] == 'http' else 'close'}", "body": size})


def guard(**access):
    return Guard(_inner, Access(port=8080, **access))


def ask(guarded, address="/", method="GET", headers=(), body=(), kind="http", cookie=None):
    """The answer to a request: status, headers, body, and whether a websocket was accepted."""
    parts, sent, chunks = urlsplit(address), [], list(body)
    pairs = [*HOST.items()] if not any(name == "host" for name, _ in headers) else []
    pairs += [*headers, *([("cookie", f"fifthwheel_8080={cookie}")] if cookie else [])]
    scope = {"type": kind, "method": method, "path": parts.path, "query_string": parts.query.encode()}
    scope["headers"] = [(name.encode(), value.encode("latin-1")) for name, value in pairs]

    async def receive():
        return {"type": "http.request", "body": chunks.pop(0) if chunks else b"", "more_body": bool(chunks)}

    async def send(message):
        sent.append(message)

    asyncio.run(guarded(scope, receive, send))
    first = sent[0]
    answered = {name.decode(): value.decode() for name, value in first.get("headers", [])}
    return SimpleNamespace(
        status=first.get("status"), headers=answered, body=sent[-1].get("body"), accepted=first["type"][-6:] == "accept"
    )


def inside(guarded, **request):
    """The answer to a browser that has opened a page."""
    return ask(guarded, cookie=guarded._access.secret, **request)


OTHERS = ("evil.example", "127.0.0.1.evil.example", "localhost.evil", "192.168.1.7", "", "[x", "0.0.0.0", "2130706433")


def test_only_this_computer_is_answered_against_dns_rebinding():
    guarded = guard()
    for host in ("127.0.0.1", "127.0.0.1:8080", "localhost:8080", "[::1]:8080", "127.9.9.9"):
        assert ask(guarded, headers=[("host", host)]).status == 200
    for host in OTHERS:
        assert ask(guarded, headers=[("host", host)]).status == 421
        assert inside(guarded, headers=[("host", host)], method="POST").status == 421


def test_with_a_token_addresses_are_answered_but_no_names():
    remote = guard(local=False, token="correct horse")
    assert ask(remote, "/?token=correct+horse", headers=[("host", "192.168.1.7")]).status == 303
    assert ask(remote, "/?token=correct+horse", headers=[("host", "evil.example")]).status == 421


def test_requests_of_other_origins_are_refused():
    guarded, here = guard(), "http://127.0.0.1"
    for method in ("GET", "POST"):
        for origin in ("https://evil.example", "null", f"{here}:9", here, "http://localhost:8080", ""):
            assert inside(guarded, method=method, headers=[("origin", origin)]).status == 403
        assert inside(guarded, method=method, headers=[("origin", LOCAL)]).status == 200


def test_another_site_may_link_but_not_embed():
    guarded = guard()
    site = ("sec-fetch-site", "cross-site")
    assert inside(guarded, headers=[site, ("sec-fetch-mode", "navigate")]).status == 200
    for mode in ("no-cors", "cors", "same-origin"):
        assert inside(guarded, headers=[site, ("sec-fetch-mode", mode)]).status == 403
    assert inside(guarded, headers=[site, ("sec-fetch-mode", "navigate")], method="POST").status == 403


def test_only_a_page_is_answered_without_the_cookie_of_this_start():
    guarded = guard()
    for method in ("POST", "DELETE", "PUT"):
        assert ask(guarded, method=method).status == 401
        assert ask(guarded, method=method, cookie="guessed").status == 401
        assert ask(guarded, method=method, headers=[("cookie", "fifthwheel_8080=\x00;;=")]).status == 401
        assert inside(guarded, method=method).status == 200
    assert Access().secret != Access().secret


def test_websockets_need_the_cookie_and_the_own_origin():
    guarded = guard()
    assert not ask(guarded, kind="websocket", headers=[("origin", LOCAL)]).accepted
    assert inside(guarded, kind="websocket", headers=[("origin", LOCAL)]).accepted
    for header in (("origin", "https://evil.example"), ("host", "evil.example")):
        assert not inside(guarded, kind="websocket", headers=[header]).accepted


def test_the_token_is_needed_once_and_leaves_the_address():
    guarded = guard(token="correct horse")
    assert ask(guarded).status == 401
    assert ask(guarded, "/?token=wrong+horse").status == 401
    answer = ask(guarded, "/signals?token=correct%20horse")
    assert (answer.status, answer.headers["location"]) == (303, "/signals")
    assert answer.headers["set-cookie"].startswith(f"fifthwheel_8080={guarded._access.secret};")
    assert {"HttpOnly", "SameSite=Strict"} <= set(answer.headers["set-cookie"].split("; "))
    assert inside(guarded).status == 200


def test_an_address_that_begins_like_another_host_does_not_lead_there():
    answer = ask(guard(token="correct horse"), "http://127.0.0.1:8080//evil.example/?token=correct%20horse")
    assert not answer.headers["location"].startswith("//")


def test_bodies_are_limited():
    guarded = guard(max_file=5_000_000)
    for path, limit in (("/", MAX_BODY), (UPLOAD, 5_000_000), (f"{UPLOAD}/x", MAX_BODY)):
        for size, status in ((limit, 200), (limit + 1, 413)):
            answer = inside(guarded, address=path, method="POST", headers=[("content-length", str(size))])
            assert answer.status == status
    # without a length, too
    for count, received in ((5, 5_000_000), (6, None)):
        answer = inside(guarded, address=UPLOAD, method="POST", body=[b"x" * 1_000_000] * count)
        assert answer.body == received


def test_repeated_and_malformed_headers_are_refused():
    assert ask(guard(), headers=[("host", "127.0.0.1"), ("host", "evil.example")]).status == 400
    for length in ("-1", "1e3", "", "²"):
        assert ask(guard(), headers=[("content-length", length)]).status == 400


def test_answers_forbid_other_sources_and_frames():
    answer = ask(guard())
    policy = answer.headers["content-security-policy"]
    assert "default-src 'none'" in policy
    assert "http" not in policy
    assert answer.headers["x-content-type-options"] == "nosniff"
    assert answer.headers["referrer-policy"] == "no-referrer"
