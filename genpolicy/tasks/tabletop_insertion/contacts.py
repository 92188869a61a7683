"""Which contacts are forbidden, and how hard hand and held peg are pressed."""

import mujoco
import numpy as np

from genpolicy.tasks.tabletop_insertion.scene import PEG_GROUP, ROBOT_GROUP


class ContactMonitor:
    """Watches the contacts of one `MjData`, physics step by physics step.

    Forbidden: the robot with anything; the held peg with anything but the fixture, and with the
    fixture outside the contact phases. A peg that was let go may lie anywhere.
    """

    def __init__(self, model: mujoco.MjModel, data: mujoco.MjData) -> None:
        self._model, self._data = model, data
        self._groups: list[int] = model.geom_group.tolist()
        self._fixture = [model.geom(geom).name.startswith("fixture") for geom in range(model.ngeom)]
        self._contact_force = np.zeros(6)
        self._contact_allowed = False
        self.collision = False
        self.peak_n = 0.0
        self.touching = False
        self.force_n = np.zeros(3)

    def begin(self, *, contact_allowed: bool) -> None:
        """Start an action period; collision and peak force count from here."""
        self._contact_allowed = contact_allowed
        self.collision = False
        self.peak_n = 0.0

    def clear(self) -> None:
        """Nothing touches any more."""
        self.touching = False
        self.force_n = np.zeros(3)

    def inspect(self, holding: bool) -> None:
        """Judge the contacts of the physics step just made.

        Args:
            holding: The peg is in the grasp and belongs to the hand.
        """
        contact = self._data.contact
        force = np.zeros(3)
        touching = False
        for index, (first, second) in enumerate(contact.geom.tolist()):
            sign = 1.0
            ours, other = second, first
            if self._groups[first] in (ROBOT_GROUP, PEG_GROUP):
                ours, other, sign = first, second, -1.0
            if self._groups[ours] == PEG_GROUP:
                if not holding:
                    continue
                allowed = self._contact_allowed and self._fixture[other]
            else:
                allowed = False
            if not allowed:
                self.collision = True
            mujoco.mj_contactForce(self._model, self._data, index, self._contact_force)
            # Rows of the frame are the contact's axes; the force acts on the second geom.
            frame = contact.frame[index].reshape(3, 3)
            force += sign * (self._contact_force[:3] @ frame)
            touching = True
        self.touching = touching
        self.force_n = force
        self.peak_n = max(self.peak_n, float(np.sqrt(force @ force)))
