import pytest
@pytest.mark.parametrize("board", ["m4f", "m7"])
@pytest.mark.parametrize("name", ["finger", "finger_adaptive"])
def test_x(toolbox, exported, course, board, name, tmp_path):
    board = getattr(toolbox, board)
    source = exported(board.precision, name)
    toolbox.write_reference(tmp_path, course("finger")[:1500], board.precision)
    there, image = toolbox.on_board(board, source, tmp_path)
    print("COUNT", board.name, name, there.counts)
