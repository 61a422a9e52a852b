//! Traced trees at the borders of what a tree can be.
//!
//! **Input** a share of the full size. **Output** named trees as the text of SWC files, in mm.
//! **Notation** n the nodes of the large ones: 100,000 in a chain, 10,000 around a star, 2^16 in a binary tree.

use std::f64::consts::TAU;
use std::fmt::Write as _;

use espalier_geom::math;
use glam::DVec3;

/// A node: place, radius, index of the parent.
type Traced = (DVec3, f64, Option<usize>);

/// The turn from one child of a star to the next: the golden angle.
const GOLDEN_RAD: f64 = TAU * 0.381_966_011_250_105;

/// Every case by name, as the text of an SWC file; those that grow, at `share` of their full size.
///
/// ```
/// let cases = espalier_tests::degenerate::cases(0.001);
/// assert!(cases.iter().any(|(name, swc)| *name == "single node" && swc.lines().count() == 1));
/// ```
#[must_use]
pub fn cases(share: f64) -> Vec<(&'static str, String)> {
    let n = |full: f64| ((full * share).round() as usize).max(3);
    let levels = n(65_536.0).ilog2().clamp(3, 16);
    let trees = [
        ("single node", vec![(DVec3::ZERO, 1.0, None)]),
        ("two nodes", line(2, DVec3::Z, 0.1)),
        ("chain", helix(n(100_000.0))),
        ("chain, straight", line(n(100_000.0), DVec3::X, 0.4)),
        ("star of 1,000", star(n(1_000.0))),
        ("star of 10,000", star(n(10_000.0))),
        ("all points equal", line(20, DVec3::ZERO, 1.0)),
        ("collinear fork", collinear()),
        ("folded back", folded()),
        ("coincident branches", coincident()),
        ("zero-length edges", doubled(&caterpillar(10))),
        ("radii larger than edges", line(200, DVec3::new(0.1, 0.0, 0.02), 30.0)),
        ("scale 1e-12", scaled(&caterpillar(40), 1e-12)),
        ("scale 1e9", scaled(&caterpillar(40), 1e9)),
        ("caterpillar", caterpillar(n(5_000.0))),
        ("binary tree", binary(levels)),
    ];
    trees.into_iter().map(|(name, tree)| (name, swc(&tree))).collect()
}

fn swc(tree: &[Traced]) -> String {
    let mut text = String::new();
    for (idx, (at, radius, parent)) in tree.iter().enumerate() {
        let parent = parent.map_or_else(|| "-1".to_owned(), |parent| (parent + 1).to_string());
        // Writing to a string cannot fail.
        let _ = writeln!(text, "{} 3 {:e} {:e} {:e} {radius:e} {parent}", idx + 1, at.x, at.y, at.z);
    }
    text
}

fn line(n: usize, step: DVec3, radius: f64) -> Vec<Traced> {
    (0..n).map(|i| (step * i as f64, radius, i.checked_sub(1))).collect()
}

/// A chain that winds around an axis.
fn helix(n: usize) -> Vec<Traced> {
    let at = |i: usize| {
        let (sin, cos) = math::sin_cos(0.01 * i as f64);
        DVec3::new(10.0 * cos + 0.01 * i as f64, 10.0 * sin, 0.002 * i as f64)
    };
    (0..n).map(|i| (at(i), 0.05, i.checked_sub(1))).collect()
}

/// A root with n children all around it.
fn star(n: usize) -> Vec<Traced> {
    let child = |i: usize| {
        let z = 1.0 - 2.0 * (i as f64 + 0.5) / n as f64;
        let (sin, cos) = math::sin_cos(GOLDEN_RAD * i as f64 % TAU);
        let across = (1.0 - z * z).sqrt();
        (100.0 * DVec3::new(across * cos, across * sin, z), 0.3, Some(0))
    };
    std::iter::once((DVec3::ZERO, 1.0, None)).chain((0..n).map(child)).collect()
}

/// A fork all of whose branches lie on one line.
fn collinear() -> Vec<Traced> {
    let at = |x: f64, parent| (DVec3::X * x, 0.5, parent);
    vec![
        at(0.0, None),
        at(5.0, Some(0)),
        at(9.0, Some(1)),
        at(12.0, Some(1)),
        at(20.0, Some(3)),
        at(-7.0, Some(0)),
    ]
}

/// A chain that comes back on itself, exactly, again and again.
fn folded() -> Vec<Traced> {
    let at = |i: usize| DVec3::new(0.0, if i.is_multiple_of(2) { 0.0 } else { 10.0 }, 0.0);
    (0..30).map(|i: usize| (at(i), 0.2, i.checked_sub(1))).collect()
}

/// Four branches in one place.
fn coincident() -> Vec<Traced> {
    let mut tree = vec![(DVec3::ZERO, 1.0, None), (DVec3::new(0.0, 0.0, -10.0), 1.0, Some(0))];
    for _ in 0..4 {
        let hub = tree.len();
        tree.push((DVec3::new(3.0, 0.0, -15.0), 0.5, Some(1)));
        tree.push((DVec3::new(5.0, 2.0, -20.0), 0.5, Some(hub)));
    }
    tree
}

/// Each node twice, at one place.
fn doubled(tree: &[Traced]) -> Vec<Traced> {
    let twice = |(i, &(at, radius, parent)): (usize, &Traced)| {
        [(at, radius, parent.map(|parent| 2 * parent + 1)), (at, radius, Some(2 * i))]
    };
    tree.iter().enumerate().flat_map(twice).collect()
}

fn scaled(tree: &[Traced], scale: f64) -> Vec<Traced> {
    tree.iter().map(|&(at, radius, parent)| (scale * at, scale * radius, parent)).collect()
}

/// A stem with a leg at each node.
fn caterpillar(n: usize) -> Vec<Traced> {
    let mut tree: Vec<Traced> = Vec::with_capacity(2 * n);
    for i in 0..n {
        let along = i as f64;
        let (sin, cos) = math::sin_cos(along);
        let stem = DVec3::new(along, 20.0 * math::sin_cos(0.01 * along).0, 0.0);
        tree.push((stem, 0.15, i.checked_sub(1).map(|before| 2 * before)));
        tree.push((stem + 3.0 * DVec3::new(0.0, cos, sin), 0.1, Some(2 * i)));
    }
    tree
}

/// Each branch forks into two shorter ones, in a plane across that of its own fork.
fn binary(levels: u32) -> Vec<Traced> {
    let mut tree = vec![(DVec3::ZERO, 2.0, None), (DVec3::NEG_Z * 100.0, 2.0, Some(0))];
    let (mut length, mut tips) = (80.0, vec![(1, DVec3::NEG_Z, DVec3::X)]);
    for _ in 1..levels {
        let mut next = Vec::with_capacity(2 * tips.len());
        for (hub, along, across) in tips {
            for side in [-0.6, 0.6] {
                let direction = (along + side * across).normalize();
                tree.push((tree[hub].0 + length * direction, 0.02 * length, Some(hub)));
                next.push((tree.len() - 1, direction, along.cross(across).normalize()));
            }
        }
        (length, tips) = (0.8 * length, next);
    }
    tree
}
