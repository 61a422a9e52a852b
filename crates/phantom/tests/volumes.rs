//! The CT, determinism, and what is refused.

#![allow(clippy::expect_used, clippy::panic, reason = "helpers of tests fail as tests do")]

use espalier_model::{Diagnose, Volume, Voxels, diagnose::Class};
use espalier_phantom::{Error, Kind, MAX_NODES, Params, Phantom, ct, generate, grow_tree};
use glam::DVec3;

/// A coarse airway, quick enough for a debug build.
fn coarse() -> Params {
    Params { spacing_mm: [2.0; 3], ..Params::default() }
}

fn stored(volume: &Volume) -> Vec<i16> {
    match volume.voxels() {
        Voxels::I16(array) => array.iter().copied().collect(),
        other => panic!("a CT is i16, not {other:?}"),
    }
}

fn both(kind: Kind, params: &Params, seed: u64) -> (Phantom, Volume) {
    let phantom = generate(kind, params, seed).expect("legal");
    let volume = ct(&phantom, params, seed).expect("legal");
    (phantom, volume)
}

fn mean_hu(volume: &Volume, mut is_wanted: impl FnMut(usize) -> bool) -> f64 {
    let (mut sum, mut n) = (0.0, 0);
    for index in (0..volume.grid().n_voxels()).filter(|&index| is_wanted(index)) {
        sum += volume.value(index);
        n += 1;
    }
    sum / f64::from(n)
}

#[test]
fn the_same_bytes_at_any_thread_count() {
    for kind in [Kind::Airway, Kind::Vessel, Kind::Helix] {
        let params = Params { roughness: 0.1, ..coarse() };
        let with_threads = |n_threads: usize| {
            let pool = rayon::ThreadPoolBuilder::new().num_threads(n_threads).build().expect("a pool");
            pool.install(|| {
                let (phantom, volume) = both(kind, &params, 5);
                (phantom.tree, phantom.mask, stored(&volume))
            })
        };
        assert!(with_threads(1) == with_threads(2), "{kind:?}");
    }
}

#[test]
fn seeds_differ() {
    for kind in [Kind::Airway, Kind::Vessel, Kind::Neuron] {
        let tree = |seed: u64| grow_tree(kind, &Params::default(), seed).expect("legal");
        assert_ne!(tree(0), tree(1), "{kind:?}");
        assert_ne!(tree(0), tree(1 << 40), "{kind:?}: all 64 bits of the seed count");
        assert_eq!(tree(3), tree(3), "{kind:?}");
    }
    let (_, first) = both(Kind::Straight, &Params::default(), 0);
    let (_, second) = both(Kind::Straight, &Params::default(), 1);
    assert_ne!(stored(&first), stored(&second), "noise");
}

#[test]
fn the_tree_alone_is_the_phantoms_tree() {
    for kind in Kind::ALL {
        let params = coarse();
        assert_eq!(
            grow_tree(kind, &params, 2).expect("legal"),
            generate(kind, &params, 2).expect("legal").tree,
            "{kind:?}"
        );
    }
}

#[test]
fn a_chest_has_the_hu_of_a_chest() {
    let (phantom, volume) = both(Kind::Airway, &coarse(), 0);
    let grid = volume.grid().clone();
    let around = |p: DVec3, reach_mm: f64| {
        let world_from_voxel = grid.world_from_voxel();
        let grid = grid.clone();
        move |index: usize| {
            let [x, y, z] = grid.voxel(index).map(|c| c as f64);
            world_from_voxel.transform_point3(DVec3::new(x, y, z)).distance(p) < reach_mm
        }
    };
    let seed = phantom.truth.segmentation.expect("an airway can be grown").seed_mm;
    for (what, at, reach, low, high) in [
        ("trachea", seed, 5.0, -1024.0, -970.0),
        ("lung", DVec3::new(100.0, 0.0, 0.0), 12.0, -900.0, -780.0),
        ("left lung", DVec3::new(-100.0, 0.0, 0.0), 12.0, -900.0, -780.0),
        ("heart", DVec3::new(-15.0, 27.0, -68.0), 15.0, 30.0, 60.0),
        ("liver", DVec3::new(70.0, 0.0, -125.0), 10.0, 40.0, 75.0),
        ("outside", DVec3::new(155.0, -105.0, 0.0), 5.0, -1024.0, -970.0),
    ] {
        let mean = mean_hu(&volume, around(at, reach));
        assert!((low..high).contains(&mean), "{what}: {mean} HU");
    }
    // Air outside the airways exists, so a bare threshold is not enough.
    let mask = phantom.mask.expect("a mask");
    let n_other_air =
        (0..grid.n_voxels()).filter(|&i| volume.value(i) < -950.0 && !mask.bits().get(grid.voxel(i))).count();
    assert!(n_other_air > mask.n_foreground());
}

/// 6-connected growing from the suggested seed inside a band.
fn grow(volume: &Volume, phantom: &Phantom, band: [f64; 2]) -> Vec<bool> {
    let grid = volume.grid();
    let seed = phantom.truth.segmentation.expect("has a CT").seed_mm;
    let start = grid.voxel_at(grid.voxel_from_world().transform_point3(seed)).expect("inside");
    let [nx, ny, nz] = grid.shape();
    let mut grown = vec![false; grid.n_voxels()];
    let mut stack = vec![start];
    while let Some([x, y, z]) = stack.pop() {
        let index = grid.index([x, y, z]);
        if grown[index] || !(band[0]..=band[1]).contains(&volume.value(index)) {
            continue;
        }
        grown[index] = true;
        if x > 0 && y > 0 && z > 0 && x + 1 < nx && y + 1 < ny && z + 1 < nz {
            stack.extend([
                [x - 1, y, z],
                [x + 1, y, z],
                [x, y - 1, z],
                [x, y + 1, z],
                [x, y, z - 1],
                [x, y, z + 1],
            ]);
        }
    }
    grown
}

#[test]
fn the_suggested_band_finds_the_tree_and_a_wide_one_leaks() {
    for (kind, wide, least_recall) in
        [(Kind::Airway, [-1024.0, -840.0], 0.7), (Kind::Vessel, [110.0, 400.0], 0.8)]
    {
        let (phantom, volume) = both(kind, &Params::default(), 0);
        let mask = phantom.mask.as_ref().expect("a mask").to_voxels();
        let band = phantom.truth.segmentation.expect("has a CT").band_hu;
        let grown = grow(&volume, &phantom, band);
        let n_grown = grown.iter().filter(|&&v| v).count();
        let n_hit = grown.iter().zip(&mask).filter(|&(&g, &m)| g && m).count();
        let recall = n_hit as f64 / mask.iter().filter(|&&v| v).count() as f64;
        let precision = n_hit as f64 / n_grown as f64;
        assert!(recall > least_recall && precision > 0.9, "{kind:?}: recall {recall}, precision {precision}");
        // Every branch is reached: each tip of the tree has a grown voxel within two of its radii.
        let grid = volume.grid();
        let (mut n_tips, mut n_reached) = (0, 0);
        for node in (1..phantom.tree.n_nodes()).filter(|&node| phantom.tree.children(node).is_empty()) {
            let at = grid.voxel_from_world().transform_point3(phantom.tree.position_mm(node)).round();
            n_tips += 1;
            let near = (0..125).map(|i| {
                at + DVec3::new(f64::from(i % 5) - 2.0, f64::from(i / 5 % 5) - 2.0, f64::from(i / 25) - 2.0)
            });
            let is_grown = |p: DVec3| grid.voxel_at(p).is_some_and(|voxel| grown[grid.index(voxel)]);
            n_reached += usize::from(near.into_iter().any(is_grown));
        }
        assert!(
            f64::from(n_reached as u32) > 0.97 * f64::from(n_tips),
            "{kind:?}: {n_reached} of {n_tips} tips"
        );
        let n_leaked = grow(&volume, &phantom, wide).iter().filter(|&&v| v).count();
        assert!(n_leaked > 5 * n_grown, "{kind:?}: {n_leaked} from {n_grown}");
    }
}

#[test]
fn partial_volume_conserves_the_tube() {
    // Without blur and noise, the CT's excess over the surroundings is the tube's volume.
    let params = Params { noise_hu: 0.0, blur_mm: 0.0, radius_mm: 1.3, length_mm: 40.0, ..Params::default() };
    for direction in [[0.0, 0.0, 1.0], [1.0, -2.0, 0.7]] {
        let params = Params { direction, offset_voxels: [0.2, 0.4, 0.1], ..params.clone() };
        let (phantom, volume) = both(Kind::Straight, &params, 0);
        let mut excess = 0.0;
        volume.for_each_value(|hu| excess += hu / 300.0);
        let expected = phantom.truth.volume_mm3.expect("a closed form");
        assert!((excess / expected - 1.0).abs() < 0.03, "{excess} of {expected}");
    }
}

#[test]
fn noise_and_blur_are_what_was_asked_for() {
    let still = || Params { noise_hu: 0.0, ..Params::default() };
    let (_, clean) = both(Kind::Straight, &still(), 0);
    let (_, noisy) = both(Kind::Straight, &Params { noise_hu: 40.0, ..still() }, 0);
    let differences = stored(&clean)
        .iter()
        .zip(stored(&noisy))
        .map(|(&a, b)| f64::from(b) - f64::from(a))
        .collect::<Vec<_>>();
    let n = differences.len() as f64;
    let mean = differences.iter().sum::<f64>() / n;
    let deviation = (differences.iter().map(|d| d * d).sum::<f64>() / n - mean * mean).sqrt();
    assert!(mean.abs() < 0.5 && (deviation - 40.0).abs() < 0.5, "{mean} ± {deviation}");

    // Blur moves no mass: the sum over the volume stays, the peak falls.
    let sum_and_peak = |blur_mm: f64| {
        let params = Params { blur_mm, margin_mm: 12.0, radius_mm: 1.5, ..still() };
        let (_, volume) = both(Kind::Straight, &params, 0);
        stored(&volume).iter().fold((0.0, i16::MIN), |(sum, peak), &v| (sum + f64::from(v), peak.max(v)))
    };
    let ((sharp_sum, sharp_peak), (soft_sum, soft_peak)) = (sum_and_peak(0.0), sum_and_peak(2.0));
    assert!((soft_sum / sharp_sum - 1.0).abs() < 0.01, "{soft_sum} of {sharp_sum}");
    assert!(sharp_peak == 300 && soft_peak < 150, "{sharp_peak} {soft_peak}");
}

#[test]
fn bad_parameters_are_named() {
    let base = Params::default();
    for (key, params) in [
        ("spacing_mm", Params { spacing_mm: [1.0, 0.0, 1.0], ..base.clone() }),
        ("spacing_mm", Params { spacing_mm: [1.0, f64::NAN, 1.0], ..base.clone() }),
        ("offset_voxels", Params { offset_voxels: [0.0, 2.0, 0.0], ..base.clone() }),
        ("direction", Params { direction: [0.0; 3], ..base.clone() }),
        ("length_mm", Params { length_mm: -1.0, ..base.clone() }),
        ("radius_mm", Params { radius_mm: f64::INFINITY, ..base.clone() }),
        ("taper", Params { taper: 0.0, ..base.clone() }),
        ("bend_angle_deg", Params { bend_angle_deg: 180.0, ..base.clone() }),
        ("n_nodes", Params { n_nodes: 1, ..base.clone() }),
        ("n_nodes", Params { n_nodes: MAX_NODES + 1, ..base.clone() }),
        ("generations", Params { generations: 0, ..base.clone() }),
        ("generations", Params { generations: 40, ..base.clone() }),
        ("roughness", Params { roughness: 0.9, ..base.clone() }),
        ("noise_hu", Params { noise_hu: -1.0, ..base.clone() }),
        ("size", Params { size: 100.0, ..base }),
    ] {
        match generate(Kind::Straight, &params, 0) {
            Err(Error::Param(error)) => assert_eq!(error.key, key, "{error}"),
            other => panic!("{key}: {other:?}"),
        }
    }
    let wide = Params { blur_mm: 20.0, ..Params::default() };
    let phantom = generate(Kind::Straight, &wide, 0).expect("the mask is fine");
    assert!(matches!(ct(&phantom, &wide, 0), Err(Error::Param(error)) if error.key == "blur_mm"));
}

#[test]
fn limits_are_refused_before_memory_is_taken() {
    let base = Params::default();
    for (kind, params, code) in [
        (Kind::Airway, Params { spacing_mm: [0.1; 3], ..base.clone() }, "E-PHANTOM-VOXELS"),
        (
            Kind::Straight,
            Params { length_mm: 1e5, spacing_mm: [1e-4; 3], ..base.clone() },
            "E-PHANTOM-VOXELS",
        ),
        (Kind::Straight, Params { step_mm: 1e-6, ..base.clone() }, "E-PHANTOM-NODES"),
        (Kind::Helix, Params { turns: 1000.0, step_mm: 1e-3, ..base.clone() }, "E-PHANTOM-NODES"),
        (Kind::Torus, Params { step_mm: 1e-6, ..base.clone() }, "E-PHANTOM-NODES"),
        (Kind::Comb, Params { n_teeth: 100_000, step_mm: 1.0, ..base.clone() }, "E-PHANTOM-NODES"),
        (Kind::Straight, Params { radius_mm: 150.0, step_mm: 1e-3, ..base.clone() }, "E-PHANTOM-WORK"),
        (Kind::Straight, Params { length_mm: 1e-6, ..base }, "E-PHANTOM-TREE"),
    ] {
        let error = generate(kind, &params, 0).expect_err(code);
        assert_eq!(error.code(), code, "{error}");
        assert!(!error.hint().is_empty());
        assert_eq!(error.class(), if code == "E-PHANTOM-TREE" { Class::Usage } else { Class::Limit });
    }
    let neuron = generate(Kind::Neuron, &Params::default(), 0).expect("legal");
    assert!(matches!(ct(&neuron, &Params::default(), 0), Err(Error::TreeOnly { kind: "neuron" })));
}

#[test]
fn a_comb_of_ten_thousand_teeth_is_a_tree() {
    let params = Params { n_teeth: 10_000, step_mm: 5.0, ..Params::default() };
    let tree = grow_tree(Kind::Comb, &params, 0).expect("legal");
    assert_eq!(tree.n_tips(), 10_001);
    assert_eq!(tree.n_nodes(), 1 + 3 * 10_001 + 5 * 10_000);
}

#[test]
fn a_config_is_read_as_it_is_written() {
    for kind in Kind::ALL {
        assert_eq!(serde_json::to_string(&kind).expect("a name"), format!("\"{}\"", kind.name()));
    }
    let params: Params =
        serde_json::from_str(r#"{"spacing_mm": [0.7, 0.7, 1.5], "taper": 0.5}"#).expect("legal");
    assert_eq!(params, Params { spacing_mm: [0.7, 0.7, 1.5], taper: 0.5, ..Params::default() });
    let error = serde_json::from_str::<Params>(r#"{"radius": 3}"#).expect_err("an unknown key");
    assert!(error.to_string().contains("radius"), "{error}");
}
