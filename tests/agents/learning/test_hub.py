"""Models go to the Hugging Face Hub and come back the same, with a folder behind a server that stands in for the hub."""

from __future__ import annotations

import base64
import json
import os
import subprocess
import sys
from collections.abc import Iterator
from http.server import BaseHTTPRequestHandler, ThreadingHTTPServer
from pathlib import Path
from threading import Thread
from urllib.parse import unquote, urlsplit

import pytest
import yaml

from bug_gym.agents.learning.folder import CONFIG, GRAPH, TRAINED_FOLDER, WEIGHTS
from bug_gym.agents.learning.hub import HubModel

pytest.importorskip("huggingface_hub", reason="of the extra `hub`")
ROOT = Path(__file__).resolve().parents[3]
HUB = "https://huggingface.co"
SHA = "0123456789abcdef0123456789abcdef01234567"


class StandIn(BaseHTTPRequestHandler):
    """As much of the hub's HTTP as its client asks for: one revision of each repository, a folder each."""

    folder: Path
    asked: list[str]

    def log_message(self, *arguments: object) -> None:
        """Say nothing on the terminal."""

    def answer(self, content: bytes, code: int = 200, **headers: str) -> None:
        self.send_response(code)
        for name, value in {"Content-Length": str(len(content)), **headers}.items():
            self.send_header(name.replace("_", "-"), value)
        self.end_headers()
        if self.command != "HEAD":
            self.wfile.write(content)

    def answer_json(self, found: object, code: int = 200) -> None:
        self.answer(json.dumps(found).encode(), code, Content_Type="application/json")

    def body(self) -> bytes:
        return self.rfile.read(int(self.headers.get("Content-Length", "0")))

    def do_POST(self) -> None:
        path, body = unquote(urlsplit(self.path).path), self.body()
        self.asked.append(path)
        if path == "/api/repos/create":
            asked = json.loads(body)
            name = "/".join(filter(None, (asked.get("organization"), asked["name"])))
            (self.folder / name).mkdir(parents=True, exist_ok=True)
            self.answer_json({"url": f"{HUB}/{name}", "name": name, "id": name})
        elif path == "/api/validate-yaml":
            self.answer_json({"errors": [], "warnings": []})
        elif "/preupload/" in path:
            files = [
                {"path": one["path"], "uploadMode": "regular", "shouldIgnore": False}
                for one in json.loads(body)["files"]
            ]
            self.answer_json({"files": files, "commitOid": SHA})
        elif "/commit/" in path:
            repository = path.removeprefix("/api/models/").split("/commit/")[0]
            for line in map(json.loads, body.splitlines()):
                if line["key"] == "file":
                    content = base64.b64decode(line["value"]["content"])
                    (self.folder / repository / line["value"]["path"]).write_bytes(content)
            self.answer_json({"commitUrl": f"{HUB}/{repository}/commit/{SHA}", "commitOid": SHA, "success": True})
        else:
            self.answer_json({"error": f"what is {path}?"}, 404)

    def do_GET(self) -> None:
        path = unquote(urlsplit(self.path).path)
        self.asked.append(path)
        if "/resolve/" in path:
            repository, _, rest = path[1:].partition("/resolve/")
            file = self.folder / repository / rest.split("/", 1)[1]
            self.answer(file.read_bytes(), X_Repo_Commit=SHA, ETag=f'"{file.name}"')
            return
        parts = path.removeprefix("/api/models/").split("/")
        folder = self.folder / "/".join(parts[:2])
        if not folder.is_dir():
            self.answer(b"{}", 404, X_Error_Code="RepoNotFound", X_Error_Message="Repository Not Found")
            return
        files = sorted(folder.iterdir())
        if "tree" in parts:
            self.answer_json(
                [{"type": "file", "path": file.name, "size": file.stat().st_size, "oid": SHA} for file in files]
            )
        else:
            siblings = [{"rfilename": file.name} for file in files]
            self.answer_json({"id": "/".join(parts[:2]), "sha": SHA, "siblings": siblings, "private": False})

    do_HEAD = do_GET


@pytest.fixture
def hub(tmp_path: Path) -> Iterator[str]:
    """The address of a hub whose repositories are folders below tmp_path / "hub"."""
    handler = type("Hub", (StandIn,), {"folder": tmp_path / "hub", "asked": []})
    server = ThreadingHTTPServer(("127.0.0.1", 0), handler)
    Thread(target=server.serve_forever, daemon=True).start()
    yield f"http://127.0.0.1:{server.server_port}"
    server.shutdown()


def bug_gym(endpoint: str, home: Path, *arguments: str, token: str = "hf_none") -> subprocess.CompletedProcess[str]:
    """A command in a process of its own: the hub's client reads its settings when it is imported."""
    settings = {"HF_ENDPOINT": endpoint, "HF_HOME": str(home), "HF_TOKEN": token, "HF_HUB_DISABLE_XET": "1"}
    return subprocess.run(
        [sys.executable, "-m", "bug_gym", *arguments],
        cwd=ROOT, env={**os.environ, **settings, "PYTHONPATH": str(ROOT)},
        capture_output=True, text=True, check=False, timeout=120,
    )  # fmt: skip


EVALUATE = ("evaluate", "--scenario", "dynamic", "--episodes", "2", "--policies")


def test_a_model_goes_there_and_comes_back_as_it_was(hub: str, tmp_path: Path) -> None:
    pushed = bug_gym(hub, tmp_path / "one", "push", "ppo_dynamic", "hf://somebody/ppo_dynamic")
    assert pushed.returncode == 0, pushed.stderr
    there = tmp_path / "hub" / "somebody" / "ppo_dynamic"
    for name in (GRAPH, WEIGHTS, CONFIG):
        assert (there / name).read_bytes() == (TRAINED_FOLDER / "ppo_dynamic" / name).read_bytes()
    assert sorted(file.name for file in there.iterdir()) == sorted(("README.md", GRAPH, WEIGHTS, CONFIG))

    (there / "pickle.pkl").write_bytes(b"not to be fetched")
    ran = bug_gym(
        hub, tmp_path / "two", *EVALUATE, "hf://somebody/ppo_dynamic,ppo_dynamic", "--out", str(tmp_path / "out")
    )
    assert ran.returncode == 0, ran.stderr
    rows = [json.loads(line) for line in (tmp_path / "out" / "rows.jsonl").read_text().splitlines()]
    lengths = {
        name: [row["path_length"] for row in rows if row["policy"] == name] for name in {row["policy"] for row in rows}
    }
    assert len(lengths) == 2 and len(lengths["ppo_dynamic"]) == 2
    assert lengths["hf://somebody/ppo_dynamic"] == lengths["ppo_dynamic"]
    assert not list((tmp_path / "two").rglob("*.pkl"))


def test_the_card_says_what_the_hub_reads(hub: str, tmp_path: Path) -> None:
    assert bug_gym(hub, tmp_path, "push", "ppo_rush", "hf://somebody/rush").returncode == 0
    _, about, text = (tmp_path / "hub" / "somebody" / "rush" / "README.md").read_text().split("---\n", 2)
    read = yaml.safe_load(about)
    record = json.loads((TRAINED_FOLDER / "ppo_rush" / CONFIG).read_text())
    (result,) = read["model-index"][0]["results"]
    assert result["metrics"][0]["value"] == record["runs"][str(record["seed"])]["held_out"]["rush"]["success"]
    assert read["library_name"] == "bug_gym" and "hf://somebody/rush" in text


def test_a_damaged_model_goes_nowhere(hub: str, tmp_path: Path) -> None:
    model = tmp_path / "model"
    model.mkdir()
    for name in (GRAPH, WEIGHTS, CONFIG, "card.md"):
        (model / name).write_bytes((TRAINED_FOLDER / "ppo_dynamic" / name).read_bytes())
    (model / WEIGHTS).write_bytes(b"torn")
    pushed = bug_gym(hub, tmp_path, "push", f"{model}/", "hf://somebody/model")
    assert pushed.returncode == 2 and WEIGHTS in pushed.stderr
    assert not (tmp_path / "hub").exists()


@pytest.mark.parametrize(
    ("place", "told"),
    [
        ("hf://somebody/else", "hf://somebody/else cannot be fetched: "),
        ("hf://somebody", "got 'hf://somebody' as a model on the hub, expected hf://user/name"),
    ],
)
def test_what_is_not_there_is_told_in_one_line(place: str, told: str, hub: str, tmp_path: Path) -> None:
    ran = bug_gym(hub, tmp_path, *EVALUATE, place)
    assert ran.returncode == 2 and told in ran.stderr
    assert sum("error" in line for line in ran.stderr.splitlines()) == 1 and "Traceback" not in ran.stderr


def test_a_hub_that_does_not_answer_is_told_in_one_line(tmp_path: Path) -> None:
    ran = bug_gym("http://127.0.0.1:1", tmp_path, *EVALUATE, "hf://somebody/model")
    assert ran.returncode == 2 and "hf://somebody/model cannot be fetched" in ran.stderr, ran.stderr
    assert "Traceback" not in ran.stderr
    ran = bug_gym("http://127.0.0.1:1", tmp_path, "push", "ppo_dynamic", "hf://somebody/model")
    assert ran.returncode == 2 and "hf://somebody/model cannot be written" in ran.stderr, ran.stderr
    assert "Traceback" not in ran.stderr


@pytest.mark.parametrize(
    ("token", "told"), [("hf_none", "what answers is no hub: "), ("hf_nöne", "its token cannot be sent: ")]
)
def test_an_answer_that_is_no_hubs_and_a_token_that_is_none_are_told(
    token: str, told: str, hub: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch
) -> None:
    """As where a network answers with its page for logging in, or a token was copied with a letter too many."""
    monkeypatch.setattr(StandIn, "answer_json", lambda self, found, code=200: self.answer(b"<html>log in</html>"))
    pushed = bug_gym(hub, tmp_path, "push", "ppo_dynamic", "hf://somebody/model", token=token)
    (line,) = [line for line in pushed.stderr.splitlines() if "error" in line]
    assert pushed.returncode == 2 and line.startswith(f"bug-gym: error: hf://somebody/model cannot be written: {told}")


def test_names_on_the_hub() -> None:
    assert HubModel.of("hf://a/b") == ("a/b", None)
    assert HubModel.of("hf://a-1/b.c_d@v1/x") == ("a-1/b.c_d", "v1/x")
    for text in ("hf://a", "hf://a/b/c", "hf:///b", "hf://a/../b", "hf://a/b@", "hf://a b/c"):
        with pytest.raises(ValueError, match="expected hf://user/name"):
            HubModel.of(text)
