//! Whole phantom trees against their truth, a small share of `scripts/ground-truth`; and an aorta against VMTK's.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use espalier_geom::space::nearest_parameter;
use espalier_phantom::Kind;
use espalier_tests::ground_truth::phantoms::{Case, Scan, measure, tree_of};
use espalier_tests::peer_ends::{self, Reason};
use espalier_tests::real_data;
use espalier_tree::Root;
use glam::DVec3;

#[test]
fn a_vessel_tree_is_found() {
    for scan in [Scan::Clean, Scan::Ct, Scan::Preset] {
        let case = Case { kind: Kind::Vessel, spacing_mm: [1.5; 3], scan, seed: 7 };
        let measured = measure(&case).expect("a tree");
        let score = measured.score;
        // At 1.5 mm the noisy CT shows two thirds of this tree's tips, and the thinnest of those poorly.
        assert!(score.off_axis_voxels <= 0.3 && score.precision() >= 0.85, "{measured}");
        if scan == Scan::Clean {
            assert!(
                score.off_axis_voxels <= 0.2 && score.recall() >= 0.95 && score.precision() >= 0.98,
                "{measured}"
            );
            assert!(score.radius_bias_voxels.abs() <= 0.08 && score.radius_mae_voxels <= 0.18, "{measured}");
            assert!(score.length_error.abs() <= 0.025 && score.angle_error_mean_deg <= 6.0, "{measured}");
        }
    }
}

/// Radii in noisy CT reach to the wall: the mask of airways, grown in a band that does not leak, ends before it.
#[test]
fn radii_in_a_scan_reach_to_its_walls() {
    for kind in [Kind::Airway, Kind::Vessel] {
        let measured =
            measure(&Case { kind, spacing_mm: [1.5; 3], scan: Scan::Ct, seed: 7 }).expect("a tree");
        let score = measured.score;
        assert!(score.radius_bias_voxels.abs() <= 0.15 && score.radius_mae_voxels <= 0.2, "{measured}");
    }
}

/// Bronchi about as wide as a voxel, in noise; no threshold and no seed given.
#[test]
fn airways_of_a_coarse_scan_are_found() {
    let case = Case { kind: Kind::Airway, spacing_mm: [1.5; 3], scan: Scan::Preset, seed: 7 };
    let measured = measure(&case).expect("a tree");
    let score = measured.score;
    assert!(score.recall() >= 0.7 && score.precision() >= 0.85 && score.stray_share <= 0.01, "{measured}");
}

/// The centreline and its radii, of a program that works on the surface. Where the section is not quite round, our radius
/// is that of its area, VMTK's that of the sphere inside: the ratio is judged by its median.
#[test]
fn an_aorta_as_vmtk_has_it() {
    let Some(data) = real_data() else { return };
    let mask = data.join("volumes/vmtk_aorta_levelset_mask.nii.gz");
    let (options, params) = (espalier_volume::ReadOptions::default(), espalier_volume::Params::default());
    let mask = espalier_volume::read_mask(&mask, &options, &params).expect("a mask").mask;
    let tree = tree_of(&mask, Root::ThickestTip).expect("a tree").tree;
    assert_eq!(tree.n_tips(), 2, "one bifurcation");

    let table = std::fs::read_to_string(data.join("reference/vmtk/aorta-centerline.csv")).expect("a table");
    let (mut distances_mm, mut ratios) = (Vec::new(), Vec::new());
    for line in table.lines().skip(1) {
        let row: Vec<f64> = line.split(',').map(|cell| cell.parse().expect("a number")).collect();
        let place = DVec3::new(row[2], row[3], row[4]);
        let on_edge = |(a, b): (usize, usize)| {
            let (a, b) = (tree.nodes()[a], tree.nodes()[b]);
            let share = nearest_parameter(place, a.position_mm, b.position_mm);
            let distance_mm = place.distance(a.position_mm.lerp(b.position_mm, share));
            (distance_mm, a.radius_mm + share * (b.radius_mm - a.radius_mm))
        };
        let nearest = tree.edges().map(on_edge).min_by(|a, b| a.0.total_cmp(&b.0)).expect("an edge");
        distances_mm.push(nearest.0);
        ratios.push(nearest.1 / row[5]);
    }
    let mean_mm = distances_mm.iter().sum::<f64>() / distances_mm.len() as f64;
    ratios.sort_by(f64::total_cmp);
    let median = ratios[ratios.len() / 2];
    assert!(mean_mm <= 1.0, "{mean_mm} mm");
    assert!((0.95..=1.05).contains(&median), "{median}");
}

/// Every end of another program's skeleton of an airway on slices of 3 mm: there, or passed by, or explained.
#[test]
fn the_ends_of_a_peer_are_found() {
    let Some(data) = real_data() else { return };
    let options = espalier_volume::ReadOptions::default();
    // A skeleton of one voxel's width has no shape to interpolate.
    let read = |path: &str, thick_slices: f64| {
        let params = espalier_volume::Params {
            method: espalier_volume::Method::Mask,
            fill_cavities: false,
            close_tunnels: false,
            thick_slices,
            ..Default::default()
        };
        espalier_volume::read_mask(&data.join(path), &options, &params).expect("a mask").mask
    };
    let mask = read("volumes/airquant_airway.nii.gz", espalier_volume::Params::default().thick_slices);
    let peer = read("reference/airquant/FIXskel.nii.gz", 0.0);
    let tree = tree_of(&mask, Root::Superior).expect("a tree").tree;
    let ends = peer_ends::compare(&peer, &tree);
    let table = ends.iter().map(ToString::to_string).collect::<Vec<_>>().join("\n");
    let n_of = |is_such: fn(&Reason) -> bool| ends.iter().filter(|end| is_such(&end.reason)).count();
    assert_eq!(ends.len(), 31);
    assert_eq!(n_of(|reason| matches!(reason, Reason::Lost(_))), 0, "{table}");
    // Two are spurs in bumps; from the slices as they are five were, and one end was lost.
    let n_found =
        n_of(|reason| matches!(reason, Reason::SameEnd | Reason::RunsOn(_) | Reason::EndOfSphere(_)));
    assert!(n_found >= 28 && n_of(|reason| *reason == Reason::SameEnd) >= 14, "{table}");
}
