"""Who may look on and stop a rover, and who may start it."""

from __future__ import annotations

import pytest

from wayfarer.daemon.socket.protocol import RequestRefused
from wayfarer.remote.live.access import Access, check_page, is_local

TOKEN = "s3cret"
WRONG = ("s3cre", "s3crets", "S3CRET", "sécret", "\udcff\udcfe")
HOME = {"Host": "localhost:8088", "Origin": "http://localhost:8088"}
ABROAD = {"Host": "10.0.0.5:8088", "Origin": "http://10.0.0.5:8088"}


@pytest.fixture
def access() -> Access:
    return Access(TOKEN)


@pytest.mark.parametrize(
    "host", ["localhost:8088", "127.0.0.1:8088", "[::1]:8088", "localhost", "LOCALHOST:9000", "127.0.0.2"]
)
def test_this_computer_needs_the_token_for_the_wheels_only(access: Access, host: str) -> None:
    check_page("127.0.0.1", {"Host": host})
    tokens = (TOKEN, "", *WRONG)
    may_start = [access.check_socket("127.0.0.1", {"Host": host, "Origin": f"http://{host}"}, each) for each in tokens]
    assert may_start == [True] + [False] * (len(WRONG) + 1)


@pytest.mark.parametrize(
    "host", ["evil.example:8088", "localhost.evil.example", "127.0.0.1.nip.io", "", "[", "10.0.0.5"]
)
def test_name_that_was_made_to_lead_here_is_refused(access: Access, host: str) -> None:
    with pytest.raises(RequestRefused, match="at localhost"):
        check_page("127.0.0.1", {"Host": host})
    with pytest.raises(RequestRefused, match="at localhost"):
        access.check_socket("127.0.0.1", {"Host": host, "Origin": f"http://{host}"}, TOKEN)


@pytest.mark.parametrize("peer", ["10.0.0.9", "fe80::1%eth0", "::ffff:10.0.0.9", ""])
def test_others_need_the_token_for_everything(access: Access, peer: str) -> None:
    assert access.check_socket(peer, ABROAD, TOKEN)
    for wrong in ("", *WRONG):
        with pytest.raises(RequestRefused, match="with the token"):
            access.check_socket(peer, ABROAD, wrong)


def test_being_called_localhost_helps_nobody_from_elsewhere(access: Access) -> None:
    with pytest.raises(RequestRefused):
        access.check_socket("10.0.0.9", HOME, "")


@pytest.mark.parametrize(
    "origin", ["http://evil.example", "https://localhost:8088", "http://localhost:3000", "null", "", None]
)
def test_page_from_elsewhere_may_not_connect_through_somebodys_browser(access: Access, origin: str | None) -> None:
    for peer, headers, token in (("127.0.0.1", HOME, ""), ("10.0.0.9", ABROAD, TOKEN)):
        said = {"Host": headers["Host"]} | ({} if origin is None else {"Origin": origin})
        with pytest.raises(RequestRefused, match="own page"):
            access.check_socket(peer, said, token)


@pytest.mark.parametrize("header", ["Forwarded", "Via", "X-Forwarded-For", "X-Real-IP"])
def test_proxy_that_would_make_everybody_local_is_refused(header: str) -> None:
    with pytest.raises(RequestRefused, match="not work through a proxy"):
        check_page("127.0.0.1", {**HOME, header: "203.0.113.9"})


def test_addresses_of_this_computer_are_known() -> None:
    assert [is_local(peer) for peer in ("127.0.0.1", "127.8.9.1", "::1", "::ffff:127.0.0.1")] == [True] * 4
    assert [is_local(peer) for peer in ("10.0.0.1", "::", "0.0.0.0", "localhost", "")] == [False] * 5
