"""Signatures of submissions by OpenSSH: `ssh-keygen -Y sign -n humanclaw -f KEY submission.json` makes one."""

from __future__ import annotations

import subprocess
from pathlib import Path
from typing import Final

from humanclaw import HumanclawError, RecordError
from humanclaw.storage import read_file

NAMESPACE: Final = "humanclaw"
"""Ties a signature to its purpose: one made for another is refused."""


def signer(path: Path, allowed: Path) -> str:
    """Return who signed a file, as `allowed` names the key. The signature lies beside the file, as FILE.sig.

    allowed: OpenSSH's file of allowed signers, a name and a public key in each line. Raises RecordError if none of
    them signed this content, and HumanclawError without ssh-keygen.
    """
    signature = path.absolute().with_name(f"{path.name}.sig")
    given = ["-s", str(signature), "-f", str(allowed.absolute())]
    told = f"{path} is not signed by anybody in {allowed}."
    refused = RecordError(told, f"Sign it with: ssh-keygen -Y sign -n {NAMESPACE} -f KEY {path}")
    try:  # ssh-keygen would wait for a pipe forever.
        content, _ = read_file(path, 96 << 20), read_file(signature, 1 << 20)
    except OSError as error:
        raise refused from error
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
