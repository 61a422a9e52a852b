//! The calibre on the way from the root to a place, in one chart.
//!
//! **Input** the rows of the way, its branches, the narrow places on it. **Output** PNG and SVG.
//! **Steps** 1. Path length from the root to the right, radius upwards from 0, each axis in the unit that reads best.
//! 2. Behind the curve, for each branch on the way, mean and standard deviation of all branches of its generation: what
//! this tree has at that depth. 3. Borders of branches are hairlines; their names stand above, in rows, and are left out
//! where there is no room. 4. The reference is a broken line, with gaps inside of forks, where there is none. 5. Rings
//! mark the narrow places that the table lists, with their percentages; where it lists none, the narrowest there is.
//! **Notation** narrowing = 100 (1 − radius / reference): the diameter stenosis of [NASCET1991], whose reference is the vessel
//! beyond the narrow place. Ours is the smaller of the largest radii before and after, which is the one beyond wherever the
//! vessel tapers.
//! **Source** [NASCET1991].
//! **Cost** O(rows).

mod artist;

use espalier_model::anatomy::{ProfileRow, Spread, Stenosis};
use glam::DVec2;

use artist::Artist;

use crate::furniture::{self, Heading};
use crate::page::{MAX_PIXELS, Page};
use crate::paint::Canvas;
use crate::palette::PageColors;
use crate::params::Params;
use crate::side_by_side::SideBySide;
use crate::text::Face;
use crate::unit::LengthUnit;
use crate::{Error, svg, unit};

/// In layout units: font sizes, height of the chart, room to its left, to its right and below.
const BODY: f64 = 1.25;
const SMALL: f64 = 1.1;
const HEIGHT: f64 = 34.0;
const LEFT: f64 = 6.4;
const RIGHT: f64 = 1.5;
const BELOW: f64 = 5.4;
/// Line height over font size.
const LEADING: f64 = 1.45;

/// Rows of names of branches.
const NAME_ROWS: usize = 3;

/// A way from the root to a place.
#[derive(Clone, Debug)]
pub struct Way<'a> {
    /// What it is of, such as the name of the run and where it leads.
    pub title: String,
    /// The nodes on the way, from the root on.
    pub rows: &'a [ProfileRow],
    /// The branches on the way, in order.
    pub stretches: &'a [Stretch],
    /// The narrow places on it that `stenoses.tsv` lists.
    pub candidates: &'a [Stenosis],
    /// The narrowest place against its reference, listed or not.
    pub narrowest: Option<&'a Stenosis>,
}

/// A branch on a way.
#[derive(Clone, Debug, PartialEq)]
pub struct Stretch {
    /// Its index.
    pub branch: usize,
    /// Its generation.
    pub generation: u32,
    /// The mean radii of the branches of this generation, in mm.
    pub usual_mm: Spread,
}

/// Draws a way.
///
/// # Errors
/// [`Error`] if a parameter is out of range or the figure would be over 2²⁷ pixels.
pub fn profile(way: &Way<'_>, params: &Params) -> Result<SideBySide, Error> {
    params.validate()?;
    let (face, colors) = (Face::built_in()?, PageColors::of(params.theme));
    let width = params.width_px;
    let (unit, margin) = (Page::unit_px(width), Page::margin_px(width));
    let axes = Axes::of(way, params);
    let said = heading(way, &axes);
    let (group, heading_px) = furniture::heading(&face, &said, width, &colors);
    let names_px = NAME_ROWS as f64 * LEADING * SMALL * unit;
    let low = DVec2::new(margin + LEFT * unit, margin + heading_px + unit + names_px);
    let high = DVec2::new(f64::from(width) - margin - RIGHT * unit, low.y + HEIGHT * unit);
    let artist = Artist { axes: Axes { corners: [low, high], ..axes }, unit, colors, face: &face, params };
    let mut groups = vec![group, artist.usual(way), artist.grid(), artist.borders(way)];
    groups.extend([artist.curves(way), artist.narrow_places(way)]);
    let (legend, bottom) = artist.legend(way, high.y + BELOW * unit);
    groups.push(legend);

    let height = (bottom + margin) as u32;
    if u64::from(width) * u64::from(height) > MAX_PIXELS {
        return Err(Error::TooLarge { width, height, limit: MAX_PIXELS });
    }
    let mut canvas = Canvas::new([width, height], colors.background)?;
    canvas.mark(&groups, &face);
    Ok(SideBySide {
        png: canvas.png(),
        svg: svg::plot("profile", &way.title, &groups, ([width, height], &colors)),
    })
}

fn heading(way: &Way<'_>, axes: &Axes) -> Heading {
    let mut verdict = Vec::new();
    match way.narrowest {
        Some(place) => verdict.push(format!(
            "narrowest against its reference: {} % at {}, branch {}, radius {} of {}",
            unit::text(place.narrowing_percent, 3),
            axes.distance(place.from_root_mm),
            place.branch,
            axes.radius(place.radius_mm),
            axes.radius(place.reference_radius_mm)
        )),
        None => verdict.push("nowhere narrower than its reference".to_owned()),
    }
    if way.narrowest.is_some() && way.candidates.is_empty() {
        verdict.push("no place on the way is listed in stenoses.tsv".to_owned());
    }
    let mut facts = vec![mean(way.rows, axes)];
    if let Some(row) = least(way.rows) {
        let (radius, place) = (axes.radius(row.radius_mm), axes.distance(row.from_root_mm));
        facts.push(format!("smallest radius {radius} at {place}"));
    }
    facts.push(
        "narrowing = 1 − radius / reference (diameter stenosis); reference = the smaller of the largest radii within \
         ten radii before and after"
            .to_owned(),
    );
    Heading { title: Some(way.title.clone()), verdict, facts }
}

/// The row of the smallest radius, the first of several.
fn least(rows: &[ProfileRow]) -> Option<&ProfileRow> {
    rows.iter().min_by(|a, b| a.radius_mm.total_cmp(&b.radius_mm))
}

/// Mean and standard deviation of the radius over the length of the way, each piece at the mean of its ends.
fn mean(rows: &[ProfileRow], axes: &Axes) -> String {
    let pieces = || {
        rows.windows(2).map(|pair| {
            let length = (pair[1].from_root_mm - pair[0].from_root_mm).max(0.0);
            (length, 0.5 * (pair[0].radius_mm + pair[1].radius_mm))
        })
    };
    let length: f64 = pieces().map(|(length, _)| length).sum();
    if length <= 0.0 {
        return "a way without length".to_owned();
    }
    let mean = pieces().map(|(part, radius)| part * radius).sum::<f64>() / length;
    let variance =
        pieces().map(|(part, radius)| part * (radius - mean) * (radius - mean)).sum::<f64>() / length;
    let [mean, sd] = [mean, variance.sqrt()].map(|radius| unit::text(radius / axes.units[1].mm, 3));
    let n = rows.len();
    format!("radius {mean} ± {sd} {} over {}, {n} nodes", axes.units[1].sign, axes.length(length))
}

/// Two axes from 0 in pixels.
struct Axes {
    corners: [DVec2; 2],
    /// The ends of the axes, in mm.
    ends_mm: [f64; 2],
    /// The units of distance and radius.
    units: [LengthUnit; 2],
}

impl Axes {
    fn of(way: &Way<'_>, params: &Params) -> Self {
        let known = |value: &f64| value.is_finite() && *value > 0.0;
        let longest = way.rows.iter().map(|row| row.from_root_mm).filter(known).fold(0.0, f64::max);
        let radii =
            way.rows.iter().flat_map(|row| [row.radius_mm, row.area_radius_mm, row.reference_radius_mm]);
        let thickest = radii.filter(known).fold(0.0, f64::max);
        let or_one = |value: f64| if value > 0.0 { value } else { 1.0 };
        Self {
            corners: [DVec2::ZERO; 2],
            ends_mm: [or_one(longest), or_one(1.08 * thickest)],
            units: [longest, thickest].map(|typical_mm| LengthUnit::choose(params.unit, typical_mm)),
        }
    }

    /// The place of a distance and a radius, kept inside the axes.
    fn at(&self, from_root_mm: f64, radius_mm: f64) -> DVec2 {
        let [low, high] = self.corners;
        // A number that is none stands at the root, on the axis.
        let share = |value: f64, end: f64| {
            if value.is_nan() { 0.0 } else { (value / end).clamp(0.0, 1.0) }
        };
        let (x, y) = (share(from_root_mm, self.ends_mm[0]), share(radius_mm, self.ends_mm[1]));
        DVec2::new(low.x + x * (high.x - low.x), high.y - y * (high.y - low.y))
    }

    fn length(&self, length_mm: f64) -> String {
        format!("{} {}", unit::text(length_mm / self.units[0].mm, 4), self.units[0].sign)
    }

    fn distance(&self, from_root_mm: f64) -> String {
        format!("{} from the root", self.length(from_root_mm))
    }

    fn radius(&self, radius_mm: f64) -> String {
        format!("{} {}", unit::text(radius_mm / self.units[1].mm, 3), self.units[1].sign)
    }
}

#[cfg(test)]
mod tests {
    use glam::DVec3;

    use super::*;

    fn row(branch: usize, from_root_mm: f64, radius_mm: f64, reference_radius_mm: f64) -> ProfileRow {
        ProfileRow {
            branch,
            node: 0,
            from_start_mm: 0.0,
            from_root_mm,
            radius_mm,
            area_radius_mm: f64::NAN,
            reference_radius_mm,
            narrowing_percent: 100.0 * (1.0 - radius_mm / reference_radius_mm),
        }
    }

    fn stretch(branch: usize, mean: f64, sd: f64) -> Stretch {
        Stretch { branch, generation: branch as u32, usual_mm: Spread { mean, sd } }
    }

    fn place(from_root_mm: f64, radius_mm: f64, reference_radius_mm: f64) -> Stenosis {
        Stenosis {
            branch: 1,
            node: 4,
            position_mm: DVec3::ZERO,
            from_root_mm,
            radius_mm,
            reference_radius_mm,
            narrowing_percent: 100.0 * (1.0 - radius_mm / reference_radius_mm),
        }
    }

    fn drawn(way: &Way<'_>) -> String {
        profile(way, &Params { width_px: 800, ..Params::default() }).expect("a figure").svg
    }

    #[test]
    fn a_narrow_place_is_marked_where_it_is() {
        let rows = [
            row(0, 0.0, 2.0, 2.0),
            row(0, 10.0, 2.0, f64::NAN),
            row(1, 15.0, 1.0, 2.0),
            row(1, 40.0, 2.0, 2.0),
        ];
        let found = [place(15.0, 1.0, 2.0)];
        let way = Way {
            title: "a tube".to_owned(),
            rows: &rows,
            stretches: &[stretch(0, 2.0, f64::NAN), stretch(1, 1.8, 0.2)],
            candidates: &found,
            narrowest: found.first(),
        };
        let svg = drawn(&way);
        for said in
            [">−50 %<", "50 % at 15 mm from the root, branch 1, radius 1 mm of 2 mm", ">1 (1)<", ">0 (0)<"]
        {
            assert!(svg.contains(said), "{said}: {svg}");
        }
        // By length: 10 mm at 2, 5 mm and 25 mm at 1.5.
        assert!(svg.contains("radius 1.62 ± 0.217 mm over 40 mm, 4 nodes"), "{svg}");
        // One curve, and the border between the two branches at a quarter of the axis.
        let at = |text: &str, after: &str| -> Vec<f64> {
            let values = svg.split(after).skip(1).filter_map(|rest| rest.split(text).next()?.parse().ok());
            values.collect()
        };
        assert_eq!(svg.matches("<polyline").count(), 1);
        let (left, right) = (0.088 * 800.0, 800.0 * (1.0 - 0.022 - 0.015));
        let ring = at("\"", "<circle cx=\"")[0];
        let expected = left - 2.0 + (right - left) * 15.0 / 40.0;
        assert!((ring - expected).abs() < 3.0, "{ring} {expected}");
    }

    #[test]
    fn nothing_odd_leaves_the_chart() {
        let odd = [
            row(0, 0.0, f64::NAN, f64::NAN),
            row(0, f64::INFINITY, 0.0, 0.0),
            row(3, 1e300, f64::INFINITY, -1.0),
            row(9, -4.0, 1e-300, 1e300),
        ];
        let worst = place(f64::NAN, f64::NAN, f64::NAN);
        for rows in [&odd[..0], &odd[..1], &odd] {
            for narrowest in [None, Some(&worst)] {
                let stretches = [stretch(0, f64::NAN, 1.0), stretch(3, 1.0, f64::INFINITY)];
                let way = Way {
                    title: "<odd>".to_owned(),
                    rows,
                    stretches: &stretches,
                    candidates: &[],
                    narrowest,
                };
                let svg = drawn(&way);
                assert!(!svg.contains("NaN") && !svg.contains("inf\"") && !svg.contains("<odd>"), "{svg}");
            }
        }
    }
}
