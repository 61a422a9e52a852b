//! Points as a user writes them.
//!
//! **Input** texts such as `12.5,-40,3`, or lines of a table. **Output** [`Given`]: three numbers are a point of the
//! patient, two one of the map; the options say in which space.

use espalier_model::diagnose::{Class, Diagnose};
use thiserror::Error;

/// What the numbers of a point are.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Space {
    /// The patient: right, anterior, superior, in mm.
    Ras,
    /// The patient: left, posterior, superior, in mm, as DICOM and ITK have it.
    Lps,
    /// Voxels of the run's mask from 0, x fastest; whole numbers are centres.
    Voxel,
    /// The map: right, up, in mm.
    Plane,
    /// Pixels of `planar.png` from 0 at the upper left; whole numbers are centres.
    Pixel,
}

impl Space {
    /// The name in tables.
    #[must_use]
    pub fn name(self) -> &'static str {
        match self {
            Self::Ras => "RAS+ mm",
            Self::Lps => "LPS+ mm",
            Self::Voxel => "voxel",
            Self::Plane => "plane mm",
            Self::Pixel => "pixel",
        }
    }

    /// Whether its points have two numbers.
    #[must_use]
    pub fn is_flat(self) -> bool {
        matches!(self, Self::Plane | Self::Pixel)
    }
}

/// A point as it was given.
#[derive(Clone, Debug, PartialEq)]
pub struct Given {
    /// Its numbers; of two the third is 0.
    pub numbers: [f64; 3],
    /// What they are.
    pub space: Space,
    /// The numbers as they were written.
    pub text: String,
}

/// Why a text is no point.
#[derive(Clone, Debug, PartialEq, Eq, Error)]
pub enum PointError {
    /// Of an argument.
    #[error("{text:?} is no point: {why}")]
    Argument {
        /// The text.
        text: String,
        /// What is wrong.
        why: &'static str,
    },
    /// Of a line in a table.
    #[error("line {line}: {text:?} is no point: {why}")]
    Line {
        /// The line, from 1.
        line: usize,
        /// The text, shortened.
        text: String,
        /// What is wrong.
        why: &'static str,
    },
    /// A table without a point.
    #[error("there is no point in it")]
    Empty,
}

impl Diagnose for PointError {
    fn code(&self) -> &'static str {
        "E-LOCATE-POINT"
    }

    fn class(&self) -> Class {
        if matches!(self, Self::Argument { .. }) { Class::Usage } else { Class::Input }
    }

    fn hint(&self) -> String {
        "write X,Y,Z in RAS+ mm for a point of the patient, U,V in mm for one of the map".to_owned()
    }

    fn line(&self) -> Option<usize> {
        if let Self::Line { line, .. } = self { Some(*line) } else { None }
    }
}

/// Beyond this nothing of a body lies, in mm, voxels or pixels.
const FARTHEST: f64 = 1e9;

/// A point from one argument; of `spaces` the first is that of three numbers, the second that of two.
///
/// # Errors
/// [`PointError::Argument`] if the text is not two or three numbers.
pub fn read_point(text: &str, spaces: [Space; 2]) -> Result<Given, PointError> {
    point(text, spaces).map_err(|why| PointError::Argument { text: text.to_owned(), why })
}

/// The points of a table: one a line, numbers apart by tabs, commas or blanks. Empty lines and those that begin with #
/// are passed over; so is a first line without any number, a header.
///
/// # Errors
/// [`PointError`] with the first line that is no point.
pub fn read_points(table: &str, spaces: [Space; 2]) -> Result<Vec<Given>, PointError> {
    let table = table.strip_prefix('\u{feff}').unwrap_or(table);
    let lines = table.lines().enumerate().map(|(i, line)| (i + 1, line.trim()));
    let mut points = Vec::new();
    let mut is_first = true;
    for (line, text) in lines.filter(|(_, text)| !text.is_empty() && !text.starts_with('#')) {
        let is_header = is_first && numbers(text).all(|number| number.is_none());
        is_first = false;
        if is_header {
            continue;
        }
        let read = point(text, spaces);
        let text = || text.chars().take(60).collect();
        points.push(read.map_err(|why| PointError::Line { line, text: text(), why })?);
    }
    if points.is_empty() { Err(PointError::Empty) } else { Ok(points) }
}

fn point(text: &str, spaces: [Space; 2]) -> Result<Given, &'static str> {
    let numbers: Option<Vec<f64>> = numbers(text).collect();
    let numbers = numbers.ok_or("a part of it is no number")?;
    // Written so that a NaN is refused too.
    if !numbers.iter().all(|number| number.abs() <= FARTHEST) {
        return Err("a number is not finite, or beyond 1e9");
    }
    let (space, numbers) = match numbers[..] {
        [x, y, z] => (spaces[0], [x, y, z]),
        [u, v] => (spaces[1], [u, v, 0.0]),
        _ => return Err("it has not two or three numbers"),
    };
    let parts: Vec<&str> = parts(text).collect();
    Ok(Given { numbers, space, text: parts.join(",") })
}

fn numbers(text: &str) -> impl Iterator<Item = Option<f64>> + '_ {
    parts(text).map(|part| part.parse().ok())
}

/// The parts of a line: one comma or tab between two of them, with blanks around it, or blanks alone.
fn parts(text: &str) -> impl Iterator<Item = &str> + '_ {
    let separator = if text.contains(',') { Some(',') } else { text.contains('\t').then_some('\t') };
    let by_sign = separator.into_iter().flat_map(move |sign| text.split(sign).map(str::trim));
    let by_blank = separator.is_none().then(|| text.split_whitespace()).into_iter().flatten();
    by_sign.chain(by_blank)
}

#[cfg(test)]
mod tests {
    use super::*;

    const SPACES: [Space; 2] = [Space::Ras, Space::Plane];

    #[test]
    fn points_in_many_hands() {
        for (text, numbers, space) in [
            ("12.5,-40,3", [12.5, -40.0, 3.0], Space::Ras),
            (" -1e1 , 2 ", [-10.0, 2.0, 0.0], Space::Plane),
            ("1\t2\t3", [1.0, 2.0, 3.0], Space::Ras),
            ("1 2   3", [1.0, 2.0, 3.0], Space::Ras),
            ("+1,.5", [1.0, 0.5, 0.0], Space::Plane),
        ] {
            let given = read_point(text, SPACES).expect(text);
            assert_eq!((given.numbers, given.space), (numbers, space), "{text}");
        }
        for text in
            ["", "1", "1,2,3,4", "1,,2", "a,b,c", "1,2,NaN", "inf,0", "1e10,0", "1;2;3", "1,2,", "1 2,3 4"]
        {
            assert!(matches!(read_point(text, SPACES), Err(PointError::Argument { .. })), "{text:?}");
        }
    }

    #[test]
    fn tables_name_their_bad_line() {
        let points =
            read_points("\u{feff}x_mm\ty_mm\tz_mm\r\n# a note\n\n1\t2\t3\r\n4,5\n", SPACES).expect("points");
        assert_eq!(points.iter().map(|p| p.text.as_str()).collect::<Vec<_>>(), ["1,2,3", "4,5"]);
        assert_eq!(read_points("", SPACES), Err(PointError::Empty));
        assert_eq!(read_points("x y z\n", SPACES), Err(PointError::Empty));
        for (table, at) in [("1 2 3\nx y z\n", 2), ("# note\n1 2\n1 2 x\n", 3), ("1 x 3\n", 1)] {
            assert!(
                matches!(read_points(table, SPACES), Err(PointError::Line { line, .. }) if line == at),
                "{table}"
            );
        }
    }
}
