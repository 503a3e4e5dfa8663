"""Tables of measurements: what is read, and what is refused with its line and column."""

import numpy as np
import pandas
import pytest

import amoeboid as am

GOOD = """# a remark
theta [deg],u [um/s],u_error [um/s],c [1/um^2],c_error [1/um^2],zeta0 [mN/m],zeta0_error [mN/m],cell
30,0.1,0.01,1000,50,,,A

90,0.2,0.01,,,,,A
150,0.1,0.02,3000,60,,,B
,,,,,2.2,0.1,B
"""


def written(tmp_path, text, encoding="utf-8"):
    path = tmp_path / "cells.csv"
    path.write_bytes(text.encode(encoding))
    return path


def test_profiles_numbers_and_cells_are_read(tmp_path):
    data = am.measurements(written(tmp_path, "\ufeff" + GOOD.replace("\n", "\r\n")))
    u, c, zeta0 = data
    assert [q.name for q in data] == ["u", "c", "zeta0"]
    np.testing.assert_allclose(u.theta, np.deg2rad([30, 90, 150]))
    np.testing.assert_allclose(c.values, [1000, 3000])
    assert (c.unit, zeta0.theta, data.cells) == ("1/um^2", None, ("A", "B"))
    assert data.physical
    assert "2 cells" in repr(data)


def test_angles_from_the_rear_are_turned_round(tmp_path):
    front, rear = (am.measurements(written(tmp_path, GOOD), pole)[0] for pole in ("front", "rear"))
    np.testing.assert_allclose(rear.theta, np.pi - front.theta)


def test_dictionaries_and_tables_of_pandas_are_the_same():
    columns = {"theta": [30.0, 90.0], "c": [1.0, np.nan], "c_error": [0.1, np.nan]}
    table = pandas.DataFrame(columns)
    table.attrs["units"] = {"theta": "deg", "c": "1/um^2", "c_error": "1/um^2"}
    plain = {"theta [deg]": [30], "c [1/um^2]": [1.0], "c_error [1/um^2]": [0.1]}
    assert repr(am.measurements(table)) == repr(am.measurements(plain))


H = "theta [deg],u [um/s],u_error [um/s]\n"


@pytest.mark.parametrize(
    ("text", "message"),
    [
        (H + "30,0.1,0.01\n60,0.1x,0.01\n", r"line 3, column 'u \[um/s\]': must be a number, got"),
        (H + '30,"0,12",0.01\n', r"line 2, column 'u \[um/s\]': .* got '0,12'; write 0.12"),
        (H + "30,0.1,0\n", r"line 2, column 'u_error \[um/s\]': must be a standard deviation > 0"),
        (H + "30,0.1,\n", r"line 2, column 'u_error \[um/s\]': .* got nothing"),
        (H + "30,nan,0.1\n", r"line 2, column 'u \[um/s\]': must be a number, got 'nan'"),
        (H + "190,0.1,0.01\n", r"line 2, column 'theta \[deg\]': must be an angle from 0 to 180"),
        (H + "30,0.1\n", r"line 2: must have 3 entries, as many as there are headings, got 2"),
        (H.replace(",", ";") + "30;0.1;0.01\n", r"line 1: entries must be separated by commas"),
        (
            "theta [deg],w [um/s]\n3,4\n",
            r"line 1, column 'w \[um/s\]': unknown column 'w'; allowed",
        ),
        ("theta [deg],C [1/um^2]\n3,4\n", r"did you mean c\?"),
        ("theta [deg],u [Pa]\n3,4\n", r"line 1, column 'u \[Pa\]': the unit must have the dimen"),
        (
            "theta [deg],u [um/s],c\n3,4,5\n",
            r"either all quantities or none must have a unit, 'c' has",
        ),
        ("theta,u\n3,4\n", r"column 'theta': must be headed theta \[deg\] or theta \[rad\]"),
        ("u [um/s]\n3\n", r"column 'u \[um/s\]': needs a column theta \[deg\]"),
        ("zeta0 [mN/m]\n3\n", r"needs a column zeta0_error"),
        ("theta [deg],c_error\n3,4\n", r"needs a column 'c' of its quantity"),
        ("theta [deg],u [um/s],u [um/s]\n3,4,5\n", r"'u' occurs twice"),
        (
            "theta [deg],u [um/s],u_error [nm/s]\n3,4,5\n",
            r"must have the same unit as 'u \[um/s\]'",
        ),
        ("zeta0 [a.u.],zeta0_error [a.u.]\n3,1\n", r"only a profile may be in arbitrary units"),
        ("theta [deg],u (um/s)\n3,4\n", r"a heading must be a name and a unit in square brackets"),
        ("theta [deg],u [um/s]\n3,\n", r"with at least one value"),
        (H, r"must have a line of headings"),
        ("", r"must have a line of headings"),
        (H + '30,"0.1,0.01\n', r"line 2: must be comma-separated values"),
    ],
)
def test_a_bad_file_is_refused_with_line_and_column(tmp_path, text, message):
    with pytest.raises(am.InvalidInput, match=message):
        am.measurements(written(tmp_path, text))


def test_a_file_in_another_encoding_is_refused_with_its_line(tmp_path):
    with pytest.raises(am.InvalidInput, match="line 1: must be text in UTF-8, got the byte 0xb5"):
        am.measurements(written(tmp_path, "theta [deg],u [\u00b5m/s]\n3,4\n", "latin-1"))


def test_what_is_no_table_is_refused():
    with pytest.raises(am.InvalidInput, match="data must be the path of a CSV file"):
        am.measurements(3.0)
    with pytest.raises(am.InvalidInput, match="row 1, column 'u': must be a number, got 'x'"):
        am.measurements({"theta [deg]": [3, 4], "u": [1.0, "x"]})
