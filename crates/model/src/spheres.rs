//! The inscribed sphere at each skeleton voxel, and its file `spheres.tsv`.

use glam::DVec3;

use crate::FileError;
use crate::table::{Column, Table};

const FORMAT: &str = "espalier-spheres";
const VERSION: u32 = 2;

/// The columns of `spheres.tsv`.
pub const SPHERE_COLUMNS: [Column; 9] = [
    Column::new("sphere", "n/a", "index of the sphere: that of its skeleton voxel"),
    Column::new("x_mm", "mm", "centre in space, RAS+: towards the right"),
    Column::new("y_mm", "mm", "centre: towards the front"),
    Column::new("z_mm", "mm", "centre: upwards"),
    Column::new("radius_mm", "mm", "radius of the largest sphere inside of the mask"),
    Column::new("distance_mm", "mm", "distance from the voxel's own centre to the nearest background centre"),
    Column::new("area_radius_mm", "mm", "radius of the circle with the area of the cross-section"),
    Column::new(
        "wall_mm",
        "mm",
        "how far beyond the mask's surface the scan shows the wall, negative inside; 0 where no scan was looked at",
    ),
    Column::new(
        "is_cut",
        "n/a",
        "1 if the border of the scan cuts the sphere, so that its radius is a lower bound",
    ),
];
const COLUMNS: [&str; 9] = {
    let mut names = [""; 9];
    let mut column = 0;
    while column < names.len() {
        names[column] = SPHERE_COLUMNS[column].name;
        column += 1;
    }
    names
};

/// The largest sphere inside the mask about a skeleton voxel.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Sphere {
    /// Its centre: the sub-voxel ridge of the distance field near the voxel, RAS+ mm.
    pub center_mm: DVec3,
    /// Its radius in mm.
    pub radius_mm: f64,
    /// The exact distance from the voxel's own centre to the nearest background centre, in mm.
    pub distance_mm: f64,
    /// The radius of the circle with the area of the mask's cross-section here, in mm; `NaN` where the section
    /// has no clear direction.
    pub area_radius_mm: f64,
    /// How far beyond the mask's surface the scan shows the wall, in mm, negative inside; 0 where no scan was looked at. Not
    /// less than `-radius_mm`.
    pub wall_mm: f64,
    /// Whether the sphere touches the border of the scan, so that its radius is a lower bound.
    pub is_cut: bool,
}

/// The inscribed spheres of a skeleton, one for each of its voxels, in the same order.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct InscribedSpheres(pub Vec<Sphere>);

impl InscribedSpheres {
    /// The table `spheres.tsv`: a line with format and version, a line of column names, one line a sphere.
    ///
    /// Numbers are the shortest decimals that read back as the same `f64`, `n/a` where there is none; `is_cut` is 0
    /// or 1. Points are RAS+ mm.
    #[must_use]
    pub fn to_tsv(&self) -> String {
        let mut table = Table::with(&SPHERE_COLUMNS);
        for (sphere_idx, sphere) in self.0.iter().enumerate() {
            let area_radius = Some(sphere.area_radius_mm).filter(|radius| !radius.is_nan());
            table.row(&[
                &sphere_idx,
                &sphere.center_mm.x,
                &sphere.center_mm.y,
                &sphere.center_mm.z,
                &sphere.radius_mm,
                &sphere.distance_mm,
                &area_radius.map_or_else(|| "n/a".to_owned(), |radius| radius.to_string()),
                &sphere.wall_mm,
                &u8::from(sphere.is_cut),
            ]);
        }
        format!("# {FORMAT} {VERSION}\n{}", table.into_string())
    }

    /// Reads what [`InscribedSpheres::to_tsv`] wrote.
    ///
    /// # Errors
    /// [`FileError::Unknown`] for another format or version; [`FileError::Invalid`], with the line, where the columns
    /// are others, a cell is missing or no number, a radius is negative, or a number is not finite.
    pub fn from_tsv(text: &str) -> Result<Self, FileError> {
        let mut lines = text.lines().zip(1..);
        check_version(lines.next().map_or("", |(line, _)| line))?;
        if lines.next().is_none_or(|(line, _)| line != COLUMNS.join("\t")) {
            return Err(invalid(2, &format!("the columns must be {}", COLUMNS.join(", "))));
        }
        let sphere = |(line, line_number)| read_sphere(line).map_err(|what| invalid(line_number, &what));
        lines.map(sphere).collect::<Result<_, _>>().map(Self)
    }
}

fn invalid(line_number: usize, what: &str) -> FileError {
    FileError::Invalid { format: FORMAT, what: format!("line {line_number}: {what}") }
}

fn check_version(line: &str) -> Result<(), FileError> {
    let mut words = line.trim_start_matches('#').split_whitespace();
    let found_format = words.next().unwrap_or("unknown").to_owned();
    let found_version = words.next().and_then(|word| word.parse().ok()).unwrap_or(0);
    if found_format == FORMAT && found_version == VERSION {
        Ok(())
    } else {
        Err(FileError::Unknown { format: FORMAT, version: VERSION, found_format, found_version })
    }
}

fn read_sphere(line: &str) -> Result<Sphere, String> {
    let cells: Vec<&str> = line.split('\t').collect();
    if cells.len() != COLUMNS.len() {
        return Err(format!("{} cells where {} belong", cells.len(), COLUMNS.len()));
    }
    let number = |column: usize| -> Result<f64, String> {
        let value: Option<f64> = cells[column].parse().ok().filter(|value: &f64| value.is_finite());
        value.ok_or_else(|| format!("{} is not a finite number: {:.40}", COLUMNS[column], cells[column]))
    };
    let length = |column: usize| match number(column) {
        Ok(value) if value < 0.0 => Err(format!("{} is negative: {value}", COLUMNS[column])),
        other => other,
    };
    Ok(Sphere {
        center_mm: DVec3::new(number(1)?, number(2)?, number(3)?),
        radius_mm: length(4)?,
        distance_mm: length(5)?,
        area_radius_mm: if cells[6] == "n/a" { f64::NAN } else { length(6)? },
        wall_mm: match number(7)? {
            wall_mm if wall_mm < -length(4)? => return Err(format!("wall_mm is beyond the axis: {wall_mm}")),
            wall_mm => wall_mm,
        },
        is_cut: match cells[8] {
            "0" => false,
            "1" => true,
            other => return Err(format!("is_cut is neither 0 nor 1: {other:.40}")),
        },
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    fn sphere(radius_mm: f64, area_radius_mm: f64) -> Sphere {
        let center_mm = DVec3::new(-0.1, 1.0 / 3.0, 1.6e-5);
        Sphere {
            center_mm,
            radius_mm,
            distance_mm: 2.0_f64.sqrt(),
            area_radius_mm,
            wall_mm: -0.25 * radius_mm,
            is_cut: radius_mm > 1.0,
        }
    }

    #[test]
    fn every_bit_comes_back() {
        let spheres = InscribedSpheres(vec![sphere(0.1 + 0.2, 1e-7), sphere(1e9 / 7.0, f64::NAN)]);
        let read = InscribedSpheres::from_tsv(&spheres.to_tsv()).expect("our own file");
        assert_eq!(read.0[0], spheres.0[0]);
        assert!(read.0[1].area_radius_mm.is_nan() && read.0[1].is_cut);
        assert_eq!(read.to_tsv(), spheres.to_tsv());
        assert_eq!(InscribedSpheres::from_tsv(&InscribedSpheres::default().to_tsv()).expect("empty").0, []);
    }

    #[test]
    fn refuses_what_it_must() {
        let good = InscribedSpheres(vec![sphere(0.5, 0.5)]).to_tsv();
        for (bad, message) in [
            (String::new(), "format unknown version 0"),
            (good.replace("spheres 2", "spheres 1"), "version 1, expected"),
            (good.replace("radius_mm\t", "radius\t"), "line 2: the columns must be"),
            (good.replace("\t0\n", "\n"), "line 3: 8 cells where 9 belong"),
            (good.replace("\t0.5\t", "\tinf\t"), "radius_mm is not a finite number: inf"),
            (good.replace("\t0.5\t", "\t-0.5\t"), "radius_mm is negative: -0.5"),
            (good.replace("\t-0.125\t", "\t-0.625\t"), "wall_mm is beyond the axis: -0.625"),
            (good.replace("\t0\n", "\tno\n"), "is_cut is neither 0 nor 1: no"),
        ] {
            let error = InscribedSpheres::from_tsv(&bad).expect_err(message).to_string();
            assert!(error.contains(message), "{error} | {message}");
        }
    }
}
