"""Measured and third-party machine data: where each file lives, its SHA-256, licence and citation.

`fetch` looks in the folder named by the environment variable SENSORLESS_DATA (one sub-folder per
data set), then in the cache (SENSORLESS_CACHE, else the user's), then downloads with pooch
(`pip install 'sensorless-sandbox[data]'`) into the cache, unless SENSORLESS_OFFLINE is set.  Every
file is hash-checked.
"""

from __future__ import annotations

import hashlib
import importlib
import os
from dataclasses import dataclass
from pathlib import Path

from model.errors import BadInput, unknown

VARIABLE = "SENSORLESS_DATA"
OFFLINE = "SENSORLESS_OFFLINE"  # set to anything but 0: nothing is downloaded


@dataclass(frozen=True)
class DataFile:
    """One file: its name in the data set's folder, its hash, its public address (None: it has none
    of its own)."""

    name: str
    sha256: str
    address: str | None


@dataclass(frozen=True)
class DataSet:
    """Files that belong together; `measured` is False for finite elements, `note` says what to be
    careful about."""

    name: str
    line: str
    files: tuple[DataFile, ...]
    licence: str
    citation: str
    measured: bool
    note: str


def _github(repository: str, commit: str, *files: tuple[str, str, str]) -> tuple[DataFile, ...]:
    """Return files (name, path in the repository, SHA-256) of one commit."""
    address = f"https://raw.githubusercontent.com/{repository}/{commit}/"
    return tuple(DataFile(name, sha, address + path) for name, path, sha in files)


# The hashes are those of these commits' files, except that of thor_fea, a repacked file.
_MOTULATOR = "8c2981dc5ee66f4216a9f077dba04534d3dd55eb"  # mhinkkan/motulator, main, July 2026
# Aalto-Electric-Drives/motulator, August 2024
_MOTULATOR_2024 = "9103cc43a9b0fc762ef9c717046007be24e244a7"
_SYNRM = "ee4c65e763687c8a3ffd869fc4f5e6f3558eda1a"
_MOTEUS = "db1a7623d6a7d5568e7632b974a9ab521a4d2bab"
_LAAS = "eb0391d736f1aaaf6cb0c72ea5a9b5c1350284c4"
_GRADNET = "examples/drive/gradnet/datasets"
_LD = "lib/python/moteus/test/testdata"

DATASETS = (
    DataSet(
        "baldor_pmsyrm",
        "measured flux map of a 5.6 kW PM-assisted SyRM (Baldor ECS101M0H7EF4, p = 2), "
        "21 x 27 currents",
        (
            *_github(
                "mhinkkan/motulator",
                _MOTULATOR,
                (
                    "baldor_meas.npz",
                    f"{_GRADNET}/baldor_meas.npz",
                    "de4df6ddf0dad5a93db0c9baff1f4b2d00e85c94ef3e8ba3737059d0cfec5845",
                ),
                (
                    "baldor_400rpm_map.npz",
                    "examples/drive/flux_vector/baldor_400rpm_map.npz",
                    "de4df6ddf0dad5a93db0c9baff1f4b2d00e85c94ef3e8ba3737059d0cfec5845",
                ),
            ),
            *_github(
                "Aalto-Electric-Drives/motulator",
                _MOTULATOR_2024,
                (
                    "ABB_400rpm_map.mat",
                    "examples/drive/flux_vector/ABB_400rpm_map.mat",
                    "a4e0924e03d4437b0110ce5e20c0e38de05d03fc0f87f3562ecdb5534416f3df",
                ),
            ),
        ),
        "MIT",
        "M. Hinkkanen and others, motulator, Aalto University, "
        "github.com/Aalto-Electric-Drives/motulator",
        True,
        "the two .npz are one and the same file; the .mat is not symmetrised and shows "
        "the drift of the back-EMF",
    ),
    DataSet(
        "brusa_hsm1",
        "measured flux map and torque of a 28 kW traction motor (Brusa HSM1.10.18.04, p "
        "= 5), 59 x 59 currents",
        _github(
            "mhinkkan/motulator",
            _MOTULATOR,
            (
                "brusa_meas.npz",
                f"{_GRADNET}/brusa_meas.npz",
                "a25b96db01b7dc82c5da19fac9273ebe2e705276e96c792c3a7c53e97e547835",
            ),
        ),
        "MIT",
        "M. Hinkkanen and others, motulator, examples/drive/gradnet, github.com/mhinkkan/motulator",
        True,
        "symmetrised by its authors",
    ),
    DataSet(
        "laas_bldc",
        "runs of a small gearless motor at 1 kHz: slow scan (cogging), current sine "
        "(inertia, friction), rolling",
        _github(
            "heitor-andrade/laas_anti_cogging",
            _LAAS,
            (
                "acceleration.txt",
                "codes/done/acceleration_data/acc_current.txt",
                "dac1afeec1bf10f20e69a5d4e3e6a6be2b20a5c7eb2a5b7773ed9d4e3322cf57",
            ),
            (
                "quasi_static_scan.txt",
                "codes/Mapping/stopped_data/stopped_data.txt",
                "3a72c809e100194a660777f66addb2c081d061fbe8df542c1af4a6944d8ca3cb",
            ),
            (
                "rolling_data.txt",
                "codes/done/rolling_data/rolling_data.txt",
                "4df66b11848721d049ad9d9cf20c8128b74ce223b7b2b9ce35ed275401552bbe",
            ),
            (
                "rolling_data1.txt",
                "codes/done/rolling_data/rolling_data1.txt",
                "77fc009801a36c61f26f9e8dea549176773950711475aefcbfe4f7217f226939",
            ),
            (
                "rolling_data2.txt",
                "codes/done/rolling_data/rolling_data2.txt",
                "a2afa20a5de1e543bc1ca4338470c7134d1f9e3cac607807a99b5a4b156fbbc0",
            ),
            (
                "speed_test1.txt",
                "codes/Testing/speed_data/speed_test1.txt",
                "b098ab15e4f503952e62aad85d57ffd4cc58b4f7e0610aba09c7b61e54d5ea3f",
            ),
        ),
        "BSD-3-Clause",
        "H. Andrade, Cogging torque compensation, LAAS-CNRS 2023, "
        "github.com/heitor-andrade/laas_anti_cogging",
        True,
        "Vsupply is scaled by an unknown factor; the motor is not named, its firmware "
        "says 300 rpm/V and 12 pole pairs",
    ),
    DataSet(
        "moteus_ld",
        "steady running of four hobby motors on moteus drives at 7 d-currents: speed "
        "against v_q - R i_q",
        _github(
            "mjbots/moteus",
            _MOTEUS,
            (
                "ld_flipsky6374.json",
                f"{_LD}/ld_flipsky6374.json",
                "9fc36cd96a1510154da6af3c9b49fd19861184cc18b599eb18715117baf2c7d5",
            ),
            (
                "ld_hoverboard.json",
                f"{_LD}/ld_hoverboard.json",
                "ee085c63a3752c82a36cc2113e67738b27c21f7939f2274c702ba92687cc2681",
            ),
            (
                "ld_mad8318.json",
                f"{_LD}/ld_mad8318.json",
                "76d531f3f17d8a53cdb1f157b57c86ea602e25a69294afac2e7832fc19288ea0",
            ),
            (
                "ld_mj5208.json",
                f"{_LD}/ld_mj5208.json",
                "6e92897bc0f8763c4a6704e2eeb00c5c14f6d29fd94435fe936bd0889c2228ae",
            ),
        ),
        "Apache-2.0",
        "mjbots Robotic Systems, moteus, lib/python/moteus/test/testdata, github.com/mjbots/moteus",
        True,
        "i_q, the DC link and the PWM frequency are not recorded; v_q is the command",
    ),
    DataSet(
        "synrm_standstill",
        "standstill square-wave voltage tests of a synchronous reluctance motor at 10 "
        "kHz, and a reference flux map",
        _github(
            "KrisCCeng/SynRM-PINN",
            _SYNRM,
            (
                "UD110Q200_1000.csv",
                "data/processed/ExDataset1/cross/UD110Q200_1000.csv",
                "5c89c068a2e952e4963aafa23cc239a4c21309d5224482d5c6ea867fc4d7c930",
            ),
            (
                "UD130_500.csv",
                "data/processed/ExDataset1/d_axis/UD130_500.csv",
                "d0179417d7bc06687b7e3e434e91bef720eef4952fa76622de8fcce9f15b36c5",
            ),
            (
                "UQ100_500.csv",
                "data/processed/ExDataset1/q_axis/UQ100_500.csv",
                "c50e3d4a945b063ab40504612a9f241d3d94b98d6653e5ed2943239ea3b38c38",
            ),
            (
                "filtered_gt_cache.npz",
                "data/processed/filtered_gt_cache.npz",
                "65ebcacc4b4c8a3428a4b586221f3efde5814ad5aa718c276d3b1b7162980bff",
            ),
        ),
        "MIT (says its README; the repository holds no licence file)",
        "KrisCCeng, SynRM-PINN, doi 10.5281/zenodo.20073908, github.com/KrisCCeng/SynRM-PINN",
        True,
        "currents were pre-processed by the authors",
    ),
    DataSet(
        "thor_fea",
        "finite elements of a 5 kW PM-assisted SyRM (THOR, p = 2): flux and torque by "
        "angle, iron loss, AC resistance",
        (
            DataFile(
                "thor_fea.npz",
                "1ecfd2d241f1adcf3c440803cc170a335dc9a701cef81614b97bb5f73a5584c2",
                None,
            ),
        ),
        "Apache-2.0 (SyR-e) / MIT (motulator)",
        "SyR-e, Politecnico di Torino, github.com/SyR-e/syre_public; carried as THOR.mat "
        "by motulator's examples",
        False,
        "no measurement; repacked from motulator's THOR.mat, so only a local copy can be used",
    ),
)


def dataset_names() -> list[str]:
    """Return the names of the data sets."""
    return [entry.name for entry in DATASETS]


def catalogue() -> list[tuple[str, str]]:
    """Return (name, one line on what it is) of every data set."""
    return [(entry.name, entry.line) for entry in DATASETS]


def dataset(name: str) -> DataSet:
    """Return the registry entry of a name; BadInput with the nearest name where there is none."""
    for entry in DATASETS:
        if entry.name == name:
            return entry
    raise unknown("data set", name, dataset_names())


def cache() -> Path:
    """Return the cache folder of this package (not created): `SENSORLESS_CACHE`, else the
    user's."""
    named = os.environ.get("SENSORLESS_CACHE")
    return Path(named) if named else _users_cache()


def _users_cache() -> Path:
    base = os.environ.get("XDG_CACHE_HOME") or os.environ.get("LOCALAPPDATA")
    return (Path(base) if base else Path.home() / ".cache") / "sensorless-sandbox"


def locate(name: str) -> Path | None:
    """Return the folder of a data set that is on this machine, hash-checked, or None; never
    downloads."""
    entry = dataset(name)
    named = os.environ.get(VARIABLE)
    # the last: for what earlier versions got
    places = [*([Path(named)] if named else []), cache(), _users_cache()]
    for folder in dict.fromkeys(place / name for place in places):
        if all((folder / file.name).is_file() for file in entry.files):
            for file in entry.files:
                _verify(folder / file.name, file)
            return folder
    return None


def fetch(name: str) -> Path:
    """Return the folder that holds a data set's files: SENSORLESS_DATA, else the cache, else
    downloaded into it.

    Raises BadInput for an unknown name, a file whose hash is not the registered one, or where it
    cannot be had.
    """
    folder = locate(name)
    if folder is not None:
        return folder
    entry = dataset(name)
    where = (
        f"neither in {VARIABLE} ({os.environ.get(VARIABLE) or 'not set'}) nor in the cache "
        f"({cache()})"
    )
    remedy = f"set {VARIABLE} to a folder that holds {name}/{entry.files[0].name}"
    if any(file.address is None for file in entry.files):
        raise BadInput(
            f"data set '{name}' is {where}, and has no public address of its own; {remedy}"
        )
    if os.environ.get(OFFLINE, "0") not in ("", "0"):
        names = ", ".join(f"'{file.name}' ({file.address})" for file in entry.files[:1])
        more = f" and {len(entry.files) - 1} more of it" if len(entry.files) > 1 else ""
        # the command line sets it so
        said = "--offline" if os.environ[OFFLINE] == "--offline" else OFFLINE
        raise BadInput(
            f"data set '{name}' is not on this machine and {said} forbids a download; put "
            f"{names}{more} into '{cache() / name}'"
        )
    try:
        pooch = importlib.import_module("pooch")  # only where something must be downloaded
    except ImportError:
        raise BadInput(
            f"data set '{name}' is {where}, and downloading needs pooch; "
            f"pip install 'sensorless-sandbox[data]', or {remedy}"
        ) from None
    for file in entry.files:
        try:
            pooch.retrieve(
                file.address, f"sha256:{file.sha256}", fname=file.name, path=cache() / name
            )
        except (OSError, ValueError) as error:  # no network, no room, wrong hash
            raise BadInput(
                f"data set '{name}' is {where}, and {file.address} failed ({error}); {remedy}"
            ) from None
    return cache() / name


def _verify(path: Path, file: DataFile) -> None:
    """Raise BadInput if a file is not the registered one."""
    try:
        found = hashlib.sha256(path.read_bytes()).hexdigest()
    except OSError as error:
        raise BadInput(f"file '{path}' cannot be read: {error}") from None
    if found != file.sha256:
        raise BadInput(
            f"file '{path}' has SHA-256 {found[:12]}…, registered is {file.sha256[:12]}…; it was "
            "changed: delete it to fetch it again, or restore it"
        )
