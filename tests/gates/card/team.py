"""People with keys, who complete and sign a card."""

import base64
import datetime
import json

import yaml
from cryptography.hazmat.primitives import serialization
from cryptography.hazmat.primitives.asymmetric.ed25519 import Ed25519PrivateKey
from securesystemslib.signer import SSlibKey

from gates import proof
from gates.card.envelope_file import PAYLOAD_TYPE
from gates.card.signing import sign_card
from genpolicy.integrity.documents import canonical_json

TODAY = datetime.date(2026, 11, 21)


PEOPLE = {
    "rita": "reviewer",
    "mo": "model",
    "pia": "perception",
    "col": "controller",
    "sam": "safety",
}
AUTHORS = {"ada": "author"}


FILLED = {
    "force_limit_n": 30.0,
    "force_limit_reason": "measured at this cell",
    "spotter": "sam",
    "stop_path": "hand button to drive enable",
    "reviewer": "rita",
    "not_before": "2026-11-20",
    "expires": "2026-11-30",
    "nonce": "0123456789abcdef0",
}


KEYS = {name: Ed25519PrivateKey.generate() for name in (*PEOPLE, *AUTHORS, "eve", "sue")}
"""Made once: what a key is worth is asked of the bytes, and costs two multiplications."""


class Team:
    """People with keys, and the card they sign."""

    def __init__(self, root):
        self.root = root
        self.keys = KEYS
        self.folder = root.parent / "keys"
        self.folder.mkdir(exist_ok=True)
        for name, key in self.keys.items():
            pem = key.private_bytes(
                serialization.Encoding.PEM,
                serialization.PrivateFormat.PKCS8,
                serialization.NoEncryption(),
            )
            (self.folder / name).write_bytes(pem)
        self.allow({**PEOPLE, **AUTHORS})

    def allow(self, people):
        entries = [
            {
                "id": n,
                "name": n.title(),
                "role": r,
                "public_key": self.keys[n].public_key().public_bytes_raw().hex(),
                "emails": [f"{n}@example.org"],
            }
            for n, r in people.items()
        ]
        (self.root / "reviewers.yaml").write_text(yaml.safe_dump({"people": entries}))

    def complete(self, **changes):
        draft = json.loads((self.root / "artifacts/card/card.json").read_bytes())
        path = self.root / "completed.json"
        path.write_bytes(canonical_json({**draft, **FILLED, **changes}))
        return path

    def sign(self, path, names):
        for name in names:
            path = sign_card(self.root, card_file=path, key_file=self.folder / name, reviewer=name)
        return path

    @property
    def envelope(self):
        return self.root / "cards/trial.dsse.json"

    def forge(self, change, names=tuple(PEOPLE)):
        """Sign any payload with real keys, past every check of `sign_card`."""
        document = json.loads(self.envelope.read_bytes())
        payload = change(json.loads(base64.b64decode(document["payload"])))
        data = payload if isinstance(payload, bytes) else canonical_json(payload)
        self.write(data, names)

    def write(self, data, names, payload_type=PAYLOAD_TYPE, keyid_of=None):
        pae = b"DSSEv1 %d %b %d %b" % (
            len(payload_type),
            payload_type.encode(),
            len(data),
            data,
        )
        signatures = []
        for name in names:
            public = self.keys[(keyid_of or {}).get(name, name)].public_key()
            signatures.append(
                {
                    "keyid": SSlibKey.from_crypto(public).keyid,
                    "sig": base64.b64encode(self.keys[name].sign(pae)).decode(),
                }
            )
        self.envelope.write_bytes(
            canonical_json(
                {
                    "payload": base64.b64encode(data).decode(),
                    "payloadType": payload_type,
                    "signatures": signatures,
                }
            )
        )

    def judge(self, today=TODAY):
        return proof.judge(self.root, "E", today=today)
