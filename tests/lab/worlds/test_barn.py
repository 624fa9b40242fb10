"""BARN worlds: what is read, and what is refused."""

import pytest

from qpavoid.errors import DataError
from qpavoid.lab.worlds import barn

CYLINDER = (
    "<model name='{name}'><pose>{pose}</pose><link name='link'>{link}<collision>{inner}"
    "<geometry>{shape}</geometry></collision></link></model>"
)
ROUND = "<cylinder><radius>0.1</radius><length>1</length></cylinder>"
BOX = "<box><size>3 0.5 1</size></box>"


def model(name="a", pose="1 2 0.5 0 0 0.7", shape=ROUND, link="", inner=""):
    return CYLINDER.format(name=name, pose=pose, shape=shape, link=link, inner=inner)


def world(folder, *models):
    path = folder / "world_0.world"
    path.write_text(f"<sdf><world>{''.join(models)}</world></sdf>")
    return path


def test_a_world_is_planes_and_upright_cylinders(tmp_path):
    plane = "<plane><normal>0 0 1</normal></plane>"
    seen = "<model name='lamp'><link name='l'><visual/></link></model>"
    path = world(tmp_path, model("ground", shape=plane), seen, model())
    assert barn.read_world(path).tolist() == [[1.0, 2.0, 0.1]]


@pytest.mark.parametrize(
    ("models", "said"),
    [
        ([model(shape=BOX)], "'a' is to be one cylinder, not box"),
        ([model(shape=ROUND + ROUND)], "not cylinder, cylinder"),
        ([model(link="<pose>1 0 0 0 0 0</pose>")], "leans, or is not where"),
        ([model(inner="<pose>0 0.2 0 0 0 0</pose>")], "leans, or is not where"),
        ([model(pose="1 2 0 1.57 0 0")], "leans, or is not where"),
        ([model(pose="1 2 5 0 0 0")], "does not reach the floor"),
        ([model(pose="1 2 -nan 0 0 0")], "does not reach the floor"),
        ([model(pose="1 1e300 0 0 0 0")], "not finite or has no radius"),
        ([model(pose="1 2")], "damaged pose or radius"),
        ([model(shape=ROUND.replace("0.1", "zero"))], "damaged pose or radius"),
        ([model(shape=ROUND.replace("0.1", "-0.1"))], "has no radius"),
        ([], "no cylinder"),
        ([model(pose="1 2 0")], "damaged pose or radius"),
        (["<include><uri>model://wall</uri></include>", model()], "includes are not"),
        ([model(inner="<include/>")], "includes are not"),
        ([f"<model name='b'>{model()}</model>"], "models within models are not"),
        ([model().replace("<pose>", "<pose relative_to='b'>")], "poses relative to"),
    ],
)
def test_what_a_world_cannot_say_is_said(tmp_path, models, said):
    with pytest.raises(DataError, match=said):
        barn.read_world(world(tmp_path, *models))
