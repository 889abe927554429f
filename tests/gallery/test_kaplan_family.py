"""Which member of the family becomes the card."""

from hydrolab.paper import load_family


def test_the_choice_prefers_claims_then_reach(script):
    members = load_family().members[:3]
    assert script.choose(members, [(1, 0.5), (2, 0.0), (2, 0.1)]) == members[2]
