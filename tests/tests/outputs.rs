//! What the tree stage writes for people and other programs, from masks whose truth is known.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::{Path, PathBuf};

use espalier_model::diagnose::Class;
use espalier_model::{Diagnose, Grid, Mask, Node, Tree, Volume, Voxels, nifti_out, swc};
use espalier_phantom::{Params, rasterise};
use espalier_pipeline::{Override, Stage, WayTo, profile};
use espalier_tests::{run_range, set};
use espalier_volume::ReadOptions;
use glam::DVec3;

fn fixture(name: &str) -> PathBuf {
    Path::new(env!("CARGO_MANIFEST_DIR")).join("../fixtures").join(name)
}

/// A run up to the tree.
fn tree_run(input: &Path, out: &Path, overrides: &[Override]) -> Tree {
    run_range(input, out, overrides, (None, Some(Stage::Tree))).expect("a run");
    swc::read_tree(&fs::read_to_string(out.join("tree.swc")).expect("tree.swc")).expect("a tree")
}

/// The cells of a column.
fn column(out: &Path, file: &str, name: &str) -> Vec<String> {
    let text = fs::read_to_string(out.join(file)).expect(file);
    let index =
        text.lines().next().expect("a header").split('\t').position(|known| known == name).expect(name);
    text.lines().skip(1).map(|line| line.split('\t').nth(index).expect("a cell").to_owned()).collect()
}

fn numbers(out: &Path, file: &str, name: &str) -> Vec<f64> {
    column(out, file, name).iter().map(|cell| cell.parse().unwrap_or(f64::NAN)).collect()
}

fn voxels(path: &Path) -> Vec<f64> {
    let loaded = espalier_volume::read(path, &ReadOptions::default()).expect("a volume");
    loaded.volume.map_values(|value| value)
}

#[test]
fn a_y_is_measured_and_its_voxels_shared_out() {
    let out = tempfile::tempdir().expect("a folder");
    // The stem comes from below.
    let tree = tree_run(&fixture("y.nii.gz"), out.path(), &[set("tree.root_mm", "[0, 0, -24]")]);
    let lengths = numbers(out.path(), "branches.tsv", "length_mm");
    assert_eq!(lengths.len(), 3);
    assert!((lengths.iter().sum::<f64>() - tree.length_mm()).abs() < 1e-4 * tree.length_mm());
    let radii = numbers(out.path(), "branches.tsv", "radius_mean_mm");
    assert!(radii.iter().all(|radius| (radius - 3.0).abs() < 0.5), "{radii:?}");
    let sibling_deg = numbers(out.path(), "branches.tsv", "sibling_angle_deg")[1];
    assert!((sibling_deg - Params::default().branch_angle_deg).abs() < 6.0, "{sibling_deg}");
    assert_eq!(column(out.path(), "branches.tsv", "strahler"), ["2", "1", "1"]);
    assert_eq!(column(out.path(), "stenoses.tsv", "branch"), Vec::<String>::new());

    // Every voxel of the mask has one branch, and no other voxel has.
    let mask = voxels(&out.path().join("stages/01-volume/mask.nii.gz"));
    let labels = voxels(&out.path().join("branches.nii.gz"));
    assert!(mask.iter().zip(&labels).all(|(&inside, &label)| (inside != 0.0) == (label != 0.0)));
    for (branch, count) in numbers(out.path(), "branches.tsv", "mask_voxels").into_iter().enumerate() {
        assert_eq!(labels.iter().filter(|&&label| label == branch as f64 + 1.0).count() as f64, count);
    }

    // The three arms are equal: so are their shares, nearly.
    let volumes = numbers(out.path(), "branches.tsv", "mask_volume_mm3");
    assert!((volumes[1] / volumes[2] - 1.0).abs() < 0.1, "{volumes:?}");
    for file in
        ["tree.vtp", "tree.graphml", "generations.tsv", "profiles.tsv", "branches.ctbl", "dictionary.tsv"]
    {
        assert!(fs::metadata(out.path().join(file)).is_ok_and(|data| data.len() > 0), "{file}");
    }
}

#[test]
fn the_distance_of_every_voxel_is_written_when_asked_for() {
    let out = tempfile::tempdir().expect("a folder");
    let path = out.path().join("stages/03-radius/distance.nii.gz");
    tree_run(&fixture("y.nii.gz"), out.path(), &[]);
    assert!(!path.exists());
    tree_run(&fixture("y.nii.gz"), out.path(), &[set("radius.field", true)]);
    let file = out.path().join("stages/01-volume/mask.nii.gz");
    let volume = espalier_volume::read(&file, &ReadOptions::default()).expect("a mask").volume;
    let inside = volume.map_values(|value| value != 0.0);
    let mask = Mask::from_voxels(volume.grid().clone(), &inside);
    let (grid, spacing) = (mask.grid(), mask.grid().spacing_mm());
    let place = |index: usize| DVec3::from_array(grid.voxel(index).map(|c| c as f64)) * spacing;
    let background: Vec<DVec3> = (0..grid.n_voxels()).filter(|&i| !inside[i]).map(place).collect();
    for (index, distance) in voxels(&path).into_iter().enumerate() {
        if !inside[index] {
            assert_eq!(distance, 0.0);
        } else if index % 29 == 0 {
            let nearest = background.iter().map(|site| site.distance_squared(place(index)));
            let expected = nearest.fold(f64::INFINITY, f64::min).sqrt();
            assert!((distance - expected).abs() < 1e-5, "{distance}, not {expected}");
        }
    }
    // The memory that it may take is a limit like any other.
    let error = espalier_radius::distance_field_within(&mask, 1000).expect_err("too large");
    assert_eq!((error.code(), error.class()), ("E-RADIUS-FIELD-TOO-LARGE", Class::Limit));
}

/// A straight vessel along z whose radius falls from 4 mm to a narrow place in its middle, 4 mm long, and recovers.
fn narrowed(radius_mm: f64) -> Mask {
    let share = |z: f64| (1.0 - ((z - 30.0).abs() - 2.0).max(0.0) / 6.0).max(0.0);
    let radius_at = |z: f64| 4.0 - (4.0 - radius_mm) * share(z);
    let node = |i: usize| Node {
        position_mm: DVec3::new(0.0, 0.0, i as f64),
        radius_mm: radius_at(i as f64),
        parent: i.checked_sub(1),
        kind: 0,
    };
    let tree = Tree::new(&(0..=60).map(node).collect::<Vec<_>>()).expect("a tree");
    let params = Params { spacing_mm: [0.5; 3], margin_mm: 2.0, ..Params::default() };
    rasterise(&tree, &params, 0).expect("a mask")
}

#[test]
fn a_planted_stenosis_is_found_where_it_is() {
    let folder = tempfile::tempdir().expect("a folder");
    for (radius_mm, percent) in [(2.0, 50.0), (1.4, 65.0)] {
        let input = folder.path().join(format!("vessel-{percent}.nii.gz"));
        fs::write(&input, nifti_out::mask(&narrowed(radius_mm)).expect("bytes")).expect("write");
        let out = folder.path().join(format!("out-{percent}"));
        tree_run(&input, &out, &[set("tree.root", "superior")]);
        let found = numbers(&out, "stenoses.tsv", "narrowing_percent");
        assert_eq!(found.len(), 1, "{found:?}");
        assert!((found[0] - percent).abs() < 5.0, "{found:?}, not {percent}");
        let z = numbers(&out, "stenoses.tsv", "z_mm")[0];
        assert!((z - 30.0).abs() < 2.5, "at {z}");

        // It stands in the profile of the way to the tip as well.
        let way = profile(&out, WayTo::Branch(0)).expect("a profile");
        let narrowest = way.lines().skip(1).map(|line| line.split('\t').nth(4).expect("a radius"));
        let least = narrowest.map(|radius| radius.parse::<f64>().expect("a number")).fold(9.0, f64::min);
        assert!((least - radius_mm).abs() < 0.4, "{least}");
    }
    // A healthy vessel has none.
    let input = folder.path().join("healthy.nii.gz");
    fs::write(&input, nifti_out::mask(&narrowed(4.0)).expect("bytes")).expect("write");
    let out = folder.path().join("healthy");
    tree_run(&input, &out, &[]);
    assert_eq!(column(&out, "stenoses.tsv", "branch"), Vec::<String>::new());
}

#[test]
fn a_label_map_on_another_grid_reaches_the_branches() {
    let folder = tempfile::tempdir().expect("a folder");
    let tree = tree_run(&fixture("y.nii.gz"), &folder.path().join("plain"), &[]);
    let branches = tree.branches();
    let tip = tree.position_mm(branches.list()[1].end());
    // Label 4 is a box about one tip and its branch's outer half; 3 mm voxels.
    let (low, n) = (tip - DVec3::splat(30.0), 20);
    let grid = Grid::axis_aligned([n; 3], DVec3::splat(3.0), low).expect("a grid");
    let middle = tree.position_mm(branches.list()[1].hub).lerp(tip, 0.25);
    let values: Vec<u32> = (0..grid.n_voxels())
        .map(|index| {
            let voxel = DVec3::from_array(grid.voxel(index).map(|coordinate| coordinate as f64));
            let point = grid.world_from_voxel().transform_point3(voxel);
            if (point - middle).dot(tip - middle) > 0.0 { 4 } else { 0 }
        })
        .collect();
    let all = Mask::from_fn(grid, |_| true);
    let labels = folder.path().join("lobes.nii.gz");
    fs::write(&labels, nifti_out::labels(&all, &values).expect("bytes")).expect("write");
    let names = folder.path().join("lobes.txt");
    fs::write(&names, "4 left & lower\n").expect("write");

    let overrides = [
        set("tree.labels", labels.display()),
        set("tree.label_names", names.display()),
        set("tree.label_reach_mm", 1),
    ];
    let out = folder.path().join("labelled");
    tree_run(&fixture("y.nii.gz"), &out, &overrides);
    assert_eq!(column(&out, "branches.tsv", "label_name")[1], "left & lower");
    let share = numbers(&out, "branches.tsv", "label_share")[1];
    assert!((share - 0.75).abs() < 0.1, "{share}");
    let graph = fs::read_to_string(out.join("tree.graphml")).expect("graph");
    assert!(graph.contains("<data key=\"label_name\">left &amp; lower</data>"));
    // Where the files lie is nobody's business; what they hold is.
    let settings = fs::read_to_string(out.join("provenance/config.resolved.toml")).expect("settings");
    assert!(settings.contains("labels = \"labels.nii.gz\""), "{settings}");
    assert!(fs::read_to_string(out.join("provenance/inputs.tsv")).expect("inputs").contains("\nlabels\t"));

    // A run from the middle refuses another label map; a missing one leaves nothing behind.
    fs::write(&labels, nifti_out::labels(&all, &vec![5; values.len()]).expect("bytes")).expect("write");
    let later = run_range(&fixture("y.nii.gz"), &out, &overrides, (Some(Stage::Views), Some(Stage::Views)));
    assert!(later.expect_err("another map").to_string().contains("lobes.nii.gz"));
    let absent = [set("tree.labels", folder.path().join("no.nii.gz").display())];
    let nowhere = folder.path().join("nowhere");
    let refusal = run_range(&fixture("y.nii.gz"), &nowhere, &absent, (None, Some(Stage::Tree)));
    assert_eq!(refusal.expect_err("no such file").class(), Class::Io);
    assert!(!nowhere.exists());
}

#[test]
fn a_traced_tree_has_all_but_the_voxels() {
    let out = tempfile::tempdir().expect("a folder");
    let tree = tree_run(&fixture("neuron.swc"), out.path(), &[]);
    assert_eq!(column(out.path(), "branches.tsv", "branch").len(), tree.branches().list().len());
    assert!(out.path().join("tree.vtp").exists() && !out.path().join("branches.nii.gz").exists());
    assert!(column(out.path(), "branches.tsv", "mask_voxels").iter().all(|cell| cell == "n/a"));

    let refusal = profile(out.path(), WayTo::Node(tree.n_nodes())).expect_err("no such node");
    assert_eq!(refusal.class(), Class::Usage);
    let way = profile(out.path(), WayTo::Node(tree.n_nodes() - 1)).expect("a way");
    let from_root: Vec<f64> = way
        .lines()
        .skip(1)
        .map(|line| line.split('\t').nth(3).expect("a cell").parse().expect("a number"))
        .collect();
    assert_eq!(from_root[0], 0.0);
    assert!(from_root.windows(2).all(|pair| pair[0] < pair[1]));
    fs::write(out.path().join("profiles.tsv"), "altered\n").expect("write");
    assert_eq!(profile(out.path(), WayTo::Node(1)).expect_err("altered").class(), Class::Uncertified);
}

#[test]
fn a_volume_of_labels_reads_back_in_its_narrowest_type() {
    let grid = Grid::axis_aligned([70, 3, 2], DVec3::new(1.0, 2.0, 3.0), DVec3::ZERO).expect("a grid");
    let mask = Mask::from_fn(grid, |[x, y, _]| x > 2 && y != 1);
    let folder = tempfile::tempdir().expect("a folder");
    for (offset, is_right) in [
        (0_u32, (|voxels: &Voxels| matches!(voxels, Voxels::U8(_))) as fn(&Voxels) -> bool),
        (300, |voxels| matches!(voxels, Voxels::U16(_))),
        (70_000, |voxels| matches!(voxels, Voxels::U32(_))),
    ] {
        let values: Vec<u32> = (0..mask.n_foreground() as u32).map(|index| offset + index % 200).collect();
        let path = folder.path().join(format!("{offset}.nii.gz"));
        fs::write(&path, nifti_out::labels(&mask, &values).expect("bytes")).expect("write");
        let volume: Volume = espalier_volume::read(&path, &ReadOptions::default()).expect("a volume").volume;
        assert!(is_right(volume.voxels()));
        for (voxel, value) in mask.voxels().zip(values) {
            assert_eq!(volume.value(volume.grid().index(voxel)), f64::from(value));
        }
    }
    assert!(nifti_out::labels(&mask, &[1]).is_err());
}
