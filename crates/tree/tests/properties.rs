//! Random skeletons: whatever the voxels, radii and policies, a tree comes out, the same one every time.

mod common;

use common::{Places, tree_of};
use espalier_geom::random::{Purpose, Stream};
use espalier_model::LedgerKind;
use espalier_tree::{Params, Resample, Root, Tips};

const SHAPE: [usize; 3] = [24, 24, 12];

/// Walks that start on one another, so that forks, loops, clusters and islands arise, with radii that jump.
fn random_places(seed: u64) -> Places {
    let mut random = Stream::new(seed, Purpose::Test, 0, 0);
    let mut places: Places = Vec::new();
    for _ in 0..2 + random.below(7) {
        let mut at = if places.is_empty() || random.below(6) == 0 {
            SHAPE.map(|extent| i64::from(random.below(extent as u32)))
        } else {
            places[random.below(places.len() as u32) as usize].0.map(i64::from)
        };
        let step = [0; 3].map(|_| i64::from(random.below(3)) - 1);
        for _ in 0..3 + random.below(14) {
            let wobble = random.below(4);
            for axis in 0..3 {
                let turn = if wobble == axis as u32 { i64::from(random.below(3)) - 1 } else { 0 };
                at[axis] = (at[axis] + step[axis] + turn).clamp(0, SHAPE[axis] as i64 - 1);
            }
            places.push((at.map(|c| c as u32), random.uniform(0.0, 4.0)));
        }
    }
    places
}

#[test]
fn every_skeleton_gives_a_tree() {
    for seed in 0..400 {
        let places = random_places(seed);
        for params in [
            Params::default(),
            Params { tips: Tips::Surface, root: Root::Superior, prune_factor: 0.0, ..Params::default() },
            Params { tips: Tips::Keep, resample: Resample::None, smooth_voxels: 0.0, ..Params::default() },
            Params { root_mm: Some([5.0, 5.0, 5.0]), resample: Resample::Step, ..Params::default() },
        ] {
            let built = tree_of(&places, SHAPE, &params).expect("a tree");
            assert_eq!(built, tree_of(&places, SHAPE, &params).expect("a tree"), "seed {seed}");
            let report = |name| built.report.get(name).expect("a count");
            assert_eq!(report("tips"), built.tree.n_tips() as f64);
            assert_eq!(report("loops_cut"), built.ledger.n_of(LedgerKind::LoopCut) as f64);
            // Nothing leaves the scan by more than a voxel.
            assert!(built.tree.nodes().iter().all(|node| {
                let p = node.position_mm.to_array();
                (0..3).all(|axis| (-1.5..SHAPE[axis] as f64 + 0.5).contains(&p[axis]))
            }));
        }
    }
}
