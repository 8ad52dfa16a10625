"""What a node of the contact line does: sticks, slips, softens, drops or has weakened."""

from tcstudy.laws.shapes import SHAPES
from tcstudy.scene.contact_states import ContactState, node_states


def test_states_of_nodes() -> None:
    law = SHAPES["saw-tooth"].build(tau=1.0, delta=1.0, teeth=2, drop=0.5, decay=0.9)
    kink = float(law.kinks[law.kinks > 0.0][0])
    stick, slip, soften, drop, weakened = ContactState
    states = node_states(law, [0.0, 0.5, -0.5, kink, -kink, 1.5, -1.5], [1, 0, 0, 0, 0, 0, 0])
    assert states.tolist() == [stick, slip, slip, drop, drop, weakened, weakened]
    smooth = SHAPES["exponential"].build(a=1.0, b=0.3, delta=0.5)
    assert node_states(smooth, [0.0, 0.2, -3.0], [1, 0, 0]).tolist() == [stick, soften, soften]
    assert node_states(SHAPES["linear"].build(k=1.0), [0.3], [0]).tolist() == [slip]
