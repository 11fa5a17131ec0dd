"""Hashes of sources: which files they cover, and what makes another hash."""

from model.kernels import sources


def made(folder, files):
    """Return the hash of files of some texts, written into a folder that holds nothing else."""
    for name, text in files.items():
        path = folder / name
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text)
    sources.forget()
    found = sources.code_key("model/*.py", "model/*.toml")
    for name in files:
        (folder / name).unlink()
    return found


def test_a_hash_knows_texts_names_imports_and_data(tmp_path, monkeypatch):
    monkeypatch.setattr(sources, "ROOT", tmp_path)
    base = {
        "model/a.py": "x = 1",
        "model/b.py": "from sandbox.c import z",
        "sandbox/c.py": "z = 1",
        "model/m.toml": "R = 1",
    }
    others = [{"model/a.py": "x = 2"}, {"sandbox/c.py": "z = 2"}, {"model/m.toml": "R = 2"}]
    found = [made(tmp_path, base | other) for other in ({}, *others)]
    swapped = base | {"model/a.py": base["model/b.py"], "model/b.py": base["model/a.py"]}
    assert len({*found, made(tmp_path, swapped)}) == 5
    assert (
        made(tmp_path, base | {"sandbox/d.py": "not imported"}) == found[0] == made(tmp_path, base)
    )
