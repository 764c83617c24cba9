"""Signatures of submissions by OpenSSH: `ssh-keygen -Y sign -n humanclaw -f KEY submission.json` makes one."""

from __future__ import annotations

import subprocess
from pathlib import Path
from tempfile import TemporaryDirectory
from typing import Final

from humanclaw import HumanclawError, RecordError
from humanclaw.storage import Folder, read_file

NAMESPACE: Final = "humanclaw"
"""Ties a signature to its purpose: one made for another is refused."""


def signer(path: Path, content: bytes, allowed: Path) -> str:
    """Return who signed the content of a file, as `allowed` names the key. The signature lies beside it, as FILE.sig.

    allowed: OpenSSH's file of allowed signers, a name and a public key in each line. Raises RecordError if none of
    them signed this content, and HumanclawError without ssh-keygen.
    """
    told = f"{path} is not signed by anybody in {allowed}."
    refused = RecordError(told, f"Sign it with: ssh-keygen -Y sign -n {NAMESPACE} -f KEY {path}")
    try:
        signature = read_file(path.with_name(f"{path.name}.sig"), 1 << 20)
    except OSError as error:
        raise refused from error
    with TemporaryDirectory() as home:  # ssh-keygen would wait for a pipe forever, so it gets a copy.
        Folder(Path(home)).write("sig", signature)
        given = ["-s", str(Path(home, "sig")), "-f", str(allowed.absolute())]
        found = _keygen("find-principals", *given)
        name = found.stdout.decode("utf-8", "replace").partition("\n")[0]
        if found.returncode == 0 and name:
            found = _keygen("verify", "-n", NAMESPACE, "-I", name, *given, content=content)
    if found.returncode != 0 or not name:
        raise refused
    return name


def _keygen(action: str, *words: str, content: bytes = b"") -> subprocess.CompletedProcess[bytes]:
    try:
        return subprocess.run(["ssh-keygen", "-Y", action, *words], input=content, capture_output=True, check=False)
    except FileNotFoundError:
        raise HumanclawError("ssh-keygen is missing, which checks signatures.", "Install OpenSSH.") from None
