//! The root: a ring around its node, and its name where there is room.
//!
//! **Input** the page and what of it is taken. **Output** the ring, the name, and a line between them if they are apart.
//! **Steps** 1. Beside the root's tube, first in the direction with most room between its branches, then ever farther
//! from that direction, then farther out: the first place where the name covers nothing. 2. A name that is not beside the
//! tube has a line that leads to the ring. 3. Where there is no room at all it stands beside the tube, over whatever is
//! there.
//! **Cost** O(places tried · cells under a name).

use espalier_geom::{angle, math};
use espalier_model::Tree;
use glam::DVec2;

use crate::drawing::{Group, Mark};
use crate::page::Page;
use crate::palette::{PageColors, Rgb};
use crate::room::Grid;
use crate::scene::Scene;
use crate::text::{Anchor, Face};

/// In layout units: font size, radius of the ring, space between tube and name, step from one place to the next farther
/// one.
const SIZE: f64 = 1.3;
const RING: f64 = 0.65;
const SPACE: f64 = 0.5;
const STEP: f64 = 0.7;
/// How often a step is made: a third of the page's width.
const N_STEPS: usize = 48;
/// Directions on either side of the first, up to the opposite one.
const N_ASIDE: usize = 8;
/// A name farther than this from the tube has a line, in layout units.
const LINE_FROM: f64 = 1.6;
/// How far the branches of the root are followed to see where they head, in layout units.
const REACH: f64 = 4.0;

/// The ring alone, for panels that say nothing more.
pub(crate) fn ring(page: &Page, scene: &Scene, colors: &PageColors) -> [Mark; 2] {
    let (unit, center) = (page.unit_px, page.px(scene.points_mm[0].truncate()));
    let ring =
        |width: f64, color| Mark::Ring { center, radius_px: RING * unit, width_px: width * unit, color };
    [ring(0.42, colors.background), ring(0.2, colors.ink)]
}

/// The ring with its name, which takes its place.
pub(crate) fn root_mark(
    (page, room): (&Page, &mut Grid),
    (tree, scene): (&Tree, &Scene),
    (face, colors): (&Face, &PageColors),
) -> Group {
    let (unit, text) = (page.unit_px, "root");
    let center = page.px(scene.points_mm[0].truncate());
    let tube_px = page.radius_px(scene.radii_mm[0]).max(RING * unit);
    let size_px = SIZE * unit;
    let size = DVec2::new(f64::from(face.width(text, size_px as f32)), 0.75 * size_px);
    let away = scene.away_from_branches(tree, REACH * unit / page.px_per_mm);
    let first = angle::heading(DVec2::new(away.x, -away.y));
    let places = places(first).map(|(out, along)| {
        // The box touches the tube with whichever of its sides is nearer.
        let half = 0.5 * (size.x * along.x.abs() + size.y * along.y.abs());
        (out, center + along * (tube_px + (SPACE + out) * unit + half))
    });
    let beside =
        (0.0, center + math::unit_vector(first) * (tube_px + SPACE * unit + 0.5 * size.max_element()));
    let mut places = places.filter(|&(_, at)| room.is_free(at, size));
    let (out, middle) = places.next().unwrap_or(beside);
    room.take(middle - 0.5 * size, middle + 0.5 * size);

    let mut marks = Vec::new();
    if out > LINE_FROM {
        marks.extend(leader([center, middle], size, (unit, [colors.background, colors.ink])));
    }
    marks.extend(ring(page, scene, colors));
    marks.push(Mark::Text {
        at: middle + DVec2::new(0.0, 0.5 * size.y),
        size_px,
        anchor: Anchor::Middle,
        is_strong: false,
        color: colors.ink,
        text: text.to_owned(),
    });
    Group { name: "root-mark", marks }
}

/// How much farther out than beside the tube, in layout units, and in which direction on the page: the nearest first, of
/// these those nearest to the first direction.
fn places(first_rad: f64) -> impl Iterator<Item = (f64, DVec2)> {
    let turn = std::f64::consts::PI / N_ASIDE as f64;
    let aside = move |i: usize| {
        let sign = if i.is_multiple_of(2) { 1.0 } else { -1.0 };
        math::unit_vector(first_rad + sign * turn * i.div_ceil(2) as f64)
    };
    (0..=N_STEPS).flat_map(move |step| (0..2 * N_ASIDE).map(move |i| (STEP * step as f64, aside(i))))
}

/// The line from the ring to the nearest point of the name's box, on a rim of the paper's colour.
fn leader(
    [center, middle]: [DVec2; 2],
    size: DVec2,
    (unit, [paper, ink]): (f64, [Rgb; 2]),
) -> impl Iterator<Item = Mark> {
    let space = DVec2::splat(0.25 * unit);
    let to = center.clamp(middle - 0.5 * size - space, middle + 0.5 * size + space);
    let from = center + (to - center).normalize_or(DVec2::X) * (RING + 0.1) * unit;
    [(0.32, paper), (0.12, ink)].into_iter().map(move |(width, color)| Mark::Line {
        from,
        to,
        width_px: width * unit,
        color,
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn places_go_out_from_the_first_direction() {
        let all: Vec<(f64, DVec2)> = places(0.0).collect();
        assert_eq!(all[0], (0.0, DVec2::X));
        assert!(all[1].1.dot(DVec2::X) > 0.9 && all[2].1.dot(DVec2::X) > 0.9);
        assert!(all[15].1.dot(DVec2::NEG_X) > 0.999, "{}", all[15].1);
        assert_eq!(all[16], (STEP, DVec2::X));
    }
}
