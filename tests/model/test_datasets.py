"""The registry of measured data: complete entries, hash checks, where it looks, what it says when
there is nothing."""

from __future__ import annotations

import hashlib
import sys
import types

import pytest

from model import datasets
from model.datasets import DataFile, DataSet, catalogue, dataset, dataset_names, fetch, locate
from model.errors import BadInput


@pytest.fixture
def elsewhere(tmp_path, monkeypatch):
    """An empty data folder and an empty cache; returns the folder."""
    folder = tmp_path / "data"
    folder.mkdir()
    monkeypatch.setenv("SENSORLESS_DATA", str(folder))
    monkeypatch.delenv("SENSORLESS_CACHE", raising=False)
    monkeypatch.setenv("XDG_CACHE_HOME", str(tmp_path / "cache"))
    return folder


@pytest.fixture
def small(monkeypatch):
    """A registry of one small file, content b'abc'."""
    sha = hashlib.sha256(b"abc").hexdigest()
    entry = DataSet(
        "small", "a", (DataFile("a.txt", sha, "https://example.org/a.txt"),), "MIT", "me", True, ""
    )
    monkeypatch.setattr(datasets, "DATASETS", (entry,))
    return entry


@pytest.mark.parametrize("name", dataset_names())
def test_entry_is_complete(name):
    entry = dataset(name)
    assert entry.licence
    assert entry.citation
    assert 10 < len(entry.line) < 120
    assert (name, entry.line) in catalogue()
    assert len({file.name for file in entry.files}) == len(entry.files) > 0
    for file in entry.files:
        assert len(file.sha256) == 64
        assert set(file.sha256) <= set("0123456789abcdef")
        if file.address is None:
            assert "local" in entry.note
        else:  # a fixed commit, so that the hash stays right
            repository, commit = file.address.split("githubusercontent.com/")[1].split("/")[1:3]
            assert repository
            assert len(commit) == 40


@pytest.mark.parametrize("name", dataset_names())
def test_data_on_this_machine_has_the_registered_hashes(name):
    if locate(name) is None:
        pytest.skip(f"data set {name} is not here; set SENSORLESS_DATA")
    assert all((fetch(name) / file.name).is_file() for file in dataset(name).files)


def test_unknown_name_gets_the_nearest():
    with pytest.raises(BadInput, match="did you mean 'thor_fea'"):
        fetch("thor_fem")


def test_folder_named_by_the_variable_comes_first_then_the_cache(elsewhere, small):
    cached = datasets.cache() / "small"
    cached.mkdir(parents=True)
    (cached / "a.txt").write_bytes(b"abc")
    assert fetch("small") == cached
    (elsewhere / "small").mkdir()
    (elsewhere / "small" / "a.txt").write_bytes(b"abc")
    assert fetch("small") == elsewhere / "small"


def test_named_cache_holds_downloads_and_the_users_is_still_looked_in(
    elsewhere, small, tmp_path, monkeypatch
):
    """SENSORLESS_CACHE is the place of all that is kept; what an earlier version put into the
    user's is found there."""
    users = datasets.cache() / "small"
    monkeypatch.setenv("SENSORLESS_CACHE", str(tmp_path / "named"))
    assert datasets.cache() == tmp_path / "named"
    users.mkdir(parents=True)
    (users / "a.txt").write_bytes(b"abc")
    assert fetch("small") == users
    (datasets.cache() / "small").mkdir(parents=True)
    (datasets.cache() / "small" / "a.txt").write_bytes(b"abc")
    assert fetch("small") == datasets.cache() / "small"


def test_changed_file_is_refused(elsewhere, small):
    (elsewhere / "small").mkdir()
    (elsewhere / "small" / "a.txt").write_bytes(b"abd")
    with pytest.raises(BadInput, match="was changed"):
        fetch("small")


def test_missing_data_without_an_address_says_what_and_how(elsewhere):
    with pytest.raises(
        BadInput, match=r"'thor_fea'.*no public address.*SENSORLESS_DATA.*thor_fea\.npz"
    ) as caught:
        fetch("thor_fea")
    assert "\n" not in str(caught.value)


def test_missing_data_without_pooch_says_what_and_how(elsewhere, small, monkeypatch):
    monkeypatch.setitem(sys.modules, "pooch", None)
    with pytest.raises(BadInput, match=r"'small'.*pooch.*pip install 'sensorless-sandbox\[data\]'"):
        fetch("small")


def test_download_goes_to_the_cache_with_address_and_hash(elsewhere, small, monkeypatch):
    asked = []

    def retrieve(url, known_hash, fname, path):
        asked.append((url, known_hash))
        path.mkdir(parents=True, exist_ok=True)
        (path / fname).write_bytes(b"abc")

    monkeypatch.setitem(sys.modules, "pooch", types.SimpleNamespace(retrieve=retrieve))
    assert fetch("small") == datasets.cache() / "small"
    assert asked == [("https://example.org/a.txt", "sha256:" + small.files[0].sha256)]


@pytest.mark.parametrize(
    "error", [OSError("no network"), ValueError("hash of downloaded file does not match")]
)
def test_failed_download_is_bad_input(elsewhere, small, monkeypatch, error):
    def retrieve(*_, **__):
        raise error

    monkeypatch.setitem(sys.modules, "pooch", types.SimpleNamespace(retrieve=retrieve))
    with pytest.raises(BadInput, match=f"small.*{error}"):
        fetch("small")
