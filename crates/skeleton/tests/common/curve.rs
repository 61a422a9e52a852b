//! Curves for tests: ends of a skeleton, and pruning by the rule of tree building.
use std::collections::BTreeSet;

use espalier_model::Mask;

/// A spur is shorter than this share of the radius at its junction.
const FACTOR: f64 = 1.5;

pub(crate) type Voxel = [i64; 3];

/// The neighbours of a voxel in a set.
pub(crate) fn neighbors(set: &BTreeSet<Voxel>, voxel: Voxel) -> Vec<Voxel> {
    (0..27)
        .filter(|&bit| bit != 13)
        .map(|bit| [voxel[0] + bit % 3 - 1, voxel[1] + bit / 3 % 3 - 1, voxel[2] + bit / 9 - 1])
        .filter(|neighbor| set.contains(neighbor))
        .collect()
}

/// The voxels with exactly one neighbour.
pub(crate) fn ends(set: &BTreeSet<Voxel>) -> Vec<Voxel> {
    set.iter().copied().filter(|&voxel| neighbors(set, voxel).len() == 1).collect()
}

/// The distance to the nearest background centre, the best of the 27 voxels about one.
fn radius(mask: &Mask, center: Voxel) -> f64 {
    let at = |voxel: Voxel| {
        let mut best = f64::INFINITY;
        for reach in 1.. {
            if f64::from(reach) >= best {
                break;
            }
            let reach = i64::from(reach);
            for z in -reach..=reach {
                for y in -reach..=reach {
                    let is_rim = z.abs() == reach || y.abs() == reach;
                    for x in (-reach..=reach).step_by(if is_rim { 1 } else { 2 * reach as usize }) {
                        if !mask.contains([voxel[0] + x, voxel[1] + y, voxel[2] + z]) {
                            best = f64::min(best, ((x * x + y * y + z * z) as f64).sqrt());
                        }
                    }
                }
            }
        }
        best
    };
    let near =
        (0..27).map(|bit| [center[0] + bit % 3 - 1, center[1] + bit / 3 % 3 - 1, center[2] + bit / 9 - 1]);
    near.filter(|&voxel| mask.contains(voxel)).map(at).fold(0.0, f64::max)
}

/// The way from an end to the first voxel with three neighbours, and its length; `None` if there is none.
fn spur(set: &BTreeSet<Voxel>, end: Voxel) -> Option<(f64, Vec<Voxel>, Voxel)> {
    let (mut path, mut before, mut length) = (vec![end], end, 0.0);
    let mut current = neighbors(set, end)[0];
    loop {
        let step = path[path.len() - 1];
        length += (0..3).map(|axis| ((current[axis] - step[axis]) as f64).powi(2)).sum::<f64>().sqrt();
        let next: Vec<Voxel> = neighbors(set, current).into_iter().filter(|&v| v != step).collect();
        match next[..] {
            [] => return None,
            [only] if only != before => {
                path.push(current);
                (before, current) = (step, only);
            }
            _ => return Some((length, path, current)),
        }
    }
}

/// Prunes the shortest spur until there is none.
pub(crate) fn pruned(mut set: BTreeSet<Voxel>, mask: &Mask) -> BTreeSet<Voxel> {
    let mut radii = std::collections::BTreeMap::new();
    loop {
        let spurs = ends(&set).into_iter().filter_map(|end| spur(&set, end));
        let mut spurs: Vec<_> = spurs
            .filter(|(length, _, junction)| {
                let radius = *radii.entry(*junction).or_insert_with(|| radius(mask, *junction));
                *length < FACTOR * radius
            })
            .collect();
        spurs.sort_by(|a, b| a.0.total_cmp(&b.0).then_with(|| a.1.cmp(&b.1)));
        let mut touched = BTreeSet::new();
        let mut n_pruned = 0;
        for (_, path, junction) in spurs {
            // Spurs of one junction go one after the other: the last may be the curve's own end.
            if touched.insert(junction) && neighbors(&set, junction).iter().all(|v| touched.insert(*v)) {
                path.iter().for_each(|voxel| {
                    set.remove(voxel);
                });
                n_pruned += 1;
            }
        }
        if n_pruned == 0 {
            return set;
        }
    }
}
