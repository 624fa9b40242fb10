"""BARN worlds of one cylinder, as the challenge ships them."""

import numpy as np

WORLD = """<sdf><world><model name="a"><pose>{x} 7 0 0 0 0</pose><link><collision>
<geometry><cylinder><radius>0.075</radius></cylinder></geometry></collision></link>
</model></world></sdf>"""


def challenge(folder, *worlds):
    """Write worlds as the challenge ships them: files named by number, and paths."""
    (folder / "path_files").mkdir(parents=True)
    for world in worlds:
        (folder / f"world_{world}.world").write_text(WORLD.format(x=-4.0 + world))
        cells = [(15, row) for row in range(45)]
        np.save(folder / "path_files" / f"path_{world}.npy", cells)
    return folder
