"""Raw files come from the first mirror that has them unaltered, or not at all."""

import functools
import hashlib
import logging
import tarfile
import threading
from http.server import SimpleHTTPRequestHandler, ThreadingHTTPServer

import pytest
import yaml

from pedpred.errors import FetchError, ValueRuleError
from pedpred.sources import mirrors
from tests.conftest import ROOT, raw_folder
from tests.raw_files import write_archive

CONTENT = {
    f"seq_{place}/{name}": f"{place} {name}\n".encode() * 500
    for place in ("eth", "hotel")
    for name in ("obsmat.txt", "H.txt", "reference.png")
}
NEEDED = [name for name in CONTENT if not name.endswith("reference.png")]


@pytest.fixture(autouse=True)
def own_environment(monkeypatch):
    monkeypatch.delenv("PEDPRED_MIRROR", raising=False)
    monkeypatch.delenv("DVC_ROOT", raising=False)


@pytest.fixture
def target(tmp_path):
    return tmp_path / "data" / "raw" / "ewap"


@pytest.fixture
def mirror(tmp_path):
    return write_mirror(tmp_path / "mirror")


def write_mirror(folder):
    for name, content in CONTENT.items():
        (folder / name).parent.mkdir(parents=True, exist_ok=True)
        (folder / name).write_bytes(content)
    return folder


def part(archive, place):
    """An archive with the files of one place alone."""
    own = {name: raw for name, raw in CONTENT.items() if name.startswith(f"seq_{place}/")}
    return write_archive(archive, content=own)


def listed(folders=(), archives=(), **more):
    sums = [f"{hashlib.sha256(content).hexdigest()}  {name}" for name, content in CONTENT.items()]
    about = {"timeout_s": 2.0, "sha256sums": sums, "optional": ["reference.png"]}
    about |= {"folders": [str(f) for f in folders], "archives": [str(a) for a in archives]}
    return mirrors.Mirrors.parse("ewap", about | more)


def fetch(target, folders=(), archives=(), **more):
    mirrors.fetch(listed(folders, archives, **more), target)


def assert_fetched(target, names=tuple(CONTENT)):
    found = {str(p.relative_to(target)): p.read_bytes() for p in target.rglob("*") if p.is_file()}
    assert found == {name: CONTENT[name] for name in names}
    assert [path.name for path in target.parent.iterdir()] == [target.name], "nothing is left beside it"


# Where files come from


def test_the_picture_is_optional(target, mirror):
    for path in mirror.glob("*/reference.png"):
        path.unlink()
    fetch(target, [mirror])
    assert_fetched(target, NEEDED)


class _Quiet(SimpleHTTPRequestHandler):
    def log_message(self, *args):
        pass


@pytest.fixture
def server(tmp_path, monkeypatch):
    """The address of a web server for `tmp_path`; it has no certificate, so plain http will do for once."""
    monkeypatch.setattr(mirrors, "_SCHEMES", ("http://", "https://", "file://"))
    handler = functools.partial(_Quiet, directory=tmp_path)
    with ThreadingHTTPServer(("127.0.0.1", 0), handler) as running:
        threading.Thread(target=running.serve_forever, daemon=True).start()
        yield f"http://127.0.0.1:{running.server_port}"
        running.shutdown()


def test_from_a_web_server_after_one_without_it(target, tmp_path, server):
    write_archive(tmp_path / "a.tgz", content=CONTENT)
    fetch(target, archives=[f"{server}/nowhere.tgz", f"{server}/a.tgz"])
    assert_fetched(target)


def test_mirrors_that_have_a_part_each_complete_each_other(target, tmp_path):
    fetch(target, archives=[part(tmp_path / f"{place}.tgz", place) for place in ("hotel", "eth")])
    assert_fetched(target)


def test_files_may_have_other_names_in_an_archive(target, tmp_path):
    renamed = {f"demo/{name.upper()}": raw for name, raw in CONTENT.items()}
    decoy = {f"old/{name}": b"another" for name in renamed}
    archive = write_archive(tmp_path / "a.tgz", content=decoy | renamed)
    inside = {name: f"ewap_dataset/demo/{name.upper()}" for name in CONTENT}
    fetch(target, archives=[archive], inside=inside)
    assert_fetched(target)


def test_a_folder_may_hold_archives_as_downloaded(target, tmp_path):
    (tmp_path / "downloads").mkdir()
    for place, ending in (("eth", "tgz"), ("hotel", "tar")):
        part(tmp_path / f"downloads/of-{place}.{ending}", place)
    (tmp_path / "downloads/notes.txt").write_text("other things")
    fetch(target, [tmp_path / "downloads"])
    assert_fetched(target)


def test_order_of_the_mirrors(tmp_path, monkeypatch):
    """Experiments in the queue run in a copy of the project; relative paths hold at the original as well."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PEDPRED_MIRROR", "/own")
    monkeypatch.setenv("DVC_ROOT", "/project")
    found = mirrors.places("ewap", ["mirror/ewap", "../there"], ["a.tgz", "https://example.org/a.tgz"])
    assert found[:3] == ["/own", f"{tmp_path}/mirror/ewap", "/project/mirror/ewap"]
    assert found[3:5] == [f"{tmp_path.parent}/there", "/there"]
    assert found[5:] == [f"{tmp_path}/a.tgz", "/project/a.tgz", "https://example.org/a.tgz"]


def test_one_folder_may_hold_several_data_sets(target, tmp_path, monkeypatch):
    write_mirror(tmp_path / "all/ewap")
    (tmp_path / "all/other").mkdir()
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PEDPRED_MIRROR", "all")
    fetch(target)
    assert_fetched(target)


# Damage


@pytest.mark.parametrize("name", ["seq_eth/H.txt", "seq_hotel/reference.png"])
def test_a_damaged_mirror_is_passed_over_with_a_warning(target, mirror, tmp_path, caplog, name):
    (mirror / name).write_text("1")
    with caplog.at_level(logging.WARNING):
        fetch(target, [mirror, write_mirror(tmp_path / "second")])
    assert_fetched(target)
    assert len(caplog.records) == 1


def test_no_mirror_is_one_error_that_names_all(target, mirror, tmp_path):
    (mirror / "seq_eth/obsmat.txt").write_text("1")
    cut = write_archive(tmp_path / "cut.tgz", content=CONTENT)
    cut.write_bytes(cut.read_bytes()[:-40])
    tried = [mirror, tmp_path / "none", cut, "https://127.0.0.1:9/a.tgz"]
    with pytest.raises(FetchError) as error:
        fetch(target, tried[:2], tried[2:])
    assert [str(place) for place in (*NEEDED, *tried) if str(place) not in str(error.value)] == []
    assert list(target.parent.iterdir()) == []


def test_a_note_takes_the_place_of_files_that_nobody_has(target, tmp_path):
    elsewhere = [tmp_path / "none"], [part(tmp_path / "eth.tgz", "eth")]
    for _ in range(2):  # the same bytes each time
        mirrors.provide(listed(*elsewhere), target)
        notes = {path.relative_to(target).as_posix(): path.read_text() for path in target.rglob("*.*")}
        assert set(notes) == {f"{folder}{mirrors.NOTE}" for folder in ("", "seq_eth/", "seq_hotel/")}
        (note,) = set(notes.values())
        assert note.splitlines()[0] == listed(*elsewhere).advice
    mirrors.provide(listed([write_mirror(tmp_path / "found")]), target)
    assert_fetched(target)


@pytest.mark.parametrize("where", ["mirror", "data/raw/ewap"])
def test_altered_files_are_never_taken_for_missing(target, tmp_path, where):
    folder = write_mirror(tmp_path / where)
    (folder / "seq_eth/H.txt").write_text("1")
    with pytest.raises(FetchError) as error:
        mirrors.provide(listed([tmp_path / "mirror"]), target)
    assert error.value.damaged
    assert not list(target.rglob(mirrors.NOTE))


def test_what_is_complete_stays_and_what_is_damaged_is_replaced(target, mirror):
    fetch(target, [mirror])
    fetch(target)  # no mirror is needed any more
    assert_fetched(target)
    (target / "seq_eth/H.txt").write_text("1")
    (target / "leftover.txt").write_text("1")
    with pytest.raises(FetchError):
        fetch(target)
    assert (target / "seq_eth/obsmat.txt").exists(), "a failure leaves the old files"
    fetch(target, [mirror])
    assert_fetched(target)


# Safety


def test_an_address_without_https_is_refused(target, mirror, monkeypatch):
    address = "http://example.org/a.tgz"
    with pytest.raises(ValueRuleError):
        fetch(target, [mirror], [address])
    monkeypatch.setenv("PEDPRED_MIRROR", address)
    with pytest.raises(ValueRuleError):
        fetch(target, [mirror])
    assert not target.exists()


def test_an_address_that_leads_away_from_https_is_refused(target, tmp_path, server, monkeypatch):
    write_archive(tmp_path / "a.tgz", content=CONTENT)
    monkeypatch.setattr(mirrors, "_SCHEMES", ("https://", server[:-1]))  # asked here, answered from elsewhere
    opened = mirrors.urllib.request.urlopen

    def redirected(address, timeout):
        response = opened(address, timeout=timeout)
        response.url = address.replace("127.0.0.1", "192.0.2.1")
        return response

    monkeypatch.setattr(mirrors.urllib.request, "urlopen", redirected)
    with pytest.raises(FetchError):
        fetch(target, archives=[f"{server}/a.tgz"])


def named(name, **changed):
    member = tarfile.TarInfo(name)
    for field, value in changed.items():
        setattr(member, field, value)
    return member


@pytest.mark.parametrize(
    "member",
    [
        named("../../seq_eth/H.txt"),
        named("/seq_eth/H.txt"),
        named("ewap_dataset/seq_eth/H.txt", type=tarfile.SYMTYPE, linkname="/etc/hostname"),
        named("ewap_dataset/seq_eth/H.txt", type=tarfile.LNKTYPE, linkname="ewap_dataset/seq_eth/obsmat.txt"),
        named("ewap_dataset/seq_eth/H.txt", type=tarfile.FIFOTYPE),
    ],
    ids=["traversal", "absolute", "symlink", "hardlink", "fifo"],
)
def test_unsafe_members_are_refused(target, tmp_path, member):
    archive = write_archive(tmp_path / "a.tgz", [(member, b"")], CONTENT)
    with pytest.raises(FetchError):
        fetch(target, archives=[archive])
    assert not list(tmp_path.rglob("H.txt"))


def test_huge_members_and_endless_headers_are_refused(target, tmp_path):
    huge = [(named("seq_eth/H.txt"), bytes(2**24 + 1))]
    headers = [(named("x", type=tarfile.GNUTYPE_LONGNAME), b"y")] * 5000
    for members in (huge, headers):
        with pytest.raises(FetchError):
            fetch(target, archives=[write_archive(tmp_path / "a.tgz", members, CONTENT)])


@pytest.mark.parametrize("data_set", ["ewap", "juelich", "eth_ucy"])
def test_committed_sums_are_those_of_the_files(data_set):
    about = yaml.safe_load((ROOT / f"conf/mirrors/{data_set}.yaml").read_text())
    assert mirrors.lack(raw_folder(data_set), mirrors.Mirrors.parse(data_set, about)) is None
