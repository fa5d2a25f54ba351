from ccfem.progress import progress_bar, silent


def test_nobody_is_told_where_nobody_watches(capsys):
    with progress_bar() as progress:
        assert progress is silent
    assert capsys.readouterr() == ("", "")


def test_a_terminal_shows_what_is_done(monkeypatch, capsys):
    monkeypatch.setenv("FORCE_COLOR", "1")  # rich takes it for a terminal
    with progress_bar() as progress:
        progress("half of it", 0.5)
    assert "half of it" in capsys.readouterr().err
