//! The map knows where each of its pixels lies in the patient: a CT sampled through the EXR shows air in the airways,
//! and the same values as the picture of the scan itself.
#![allow(clippy::expect_used, reason = "a test says what it expects")]

use std::fs;
use std::path::Path;

use espalier_tests::{run, set};
use espalier_volume::ReadOptions;
use exr::prelude::{ReadChannels, ReadLayers};
use glam::DVec3;

/// The channels of the first layer, by name.
fn channels(exr: &[u8]) -> Vec<(String, Vec<f32>)> {
    let image = exr::prelude::read()
        .no_deep_data()
        .largest_resolution_level()
        .all_channels()
        .first_valid_layer()
        .all_attributes()
        .from_buffered(std::io::Cursor::new(exr))
        .expect("a readable EXR");
    let list = image.layer_data.channel_data.list;
    list.iter().map(|c| (c.name.to_string(), c.sample_data.values_as_f32().collect())).collect()
}

#[test]
fn the_ct_sampled_through_the_map_is_the_picture_of_the_scan() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines/airway.toml");
    let settings = [
        set("phantom.generations", 3),
        set("phantom.spacing_mm", "[1.5, 1.5, 1.5]"),
        set("embed.pso.particles", 24),
        set("embed.pso.iterations", 4),
        set("render.width_px", 400),
        set("render.style", "volume"),
    ];
    run(&config, folder.path(), &settings, 2).expect("a run");
    let ct = folder.path().join("stages/00-phantom/ct.nii.gz");
    let channels = channels(&fs::read(folder.path().join("planar.exr")).expect("planar.exr"));
    let channel = |name: &str| &channels.iter().find(|(known, _)| known == name).expect(name).1;
    let volume = espalier_volume::read(&ct, &ReadOptions::default()).expect("a CT").volume;
    let tree = fs::read_to_string(folder.path().join("tree.swc")).expect("tree.swc");
    let tree = espalier_model::swc::read_tree(&tree).expect("a tree");
    let shape = volume.grid().shape();
    let values = volume.map_values(|value| value);
    let voxel_from_world = volume.grid().voxel_from_world();

    // Between voxels linearly, by code of its own.
    let sampled = |place: DVec3| -> f64 {
        let voxel = voxel_from_world.transform_point3(place);
        let low = voxel.floor();
        let mut sum = 0.0;
        for corner in 0..8 {
            let step = DVec3::new(f64::from(corner & 1), f64::from(corner >> 1 & 1), f64::from(corner >> 2));
            let weight = DVec3::ONE - (voxel - low - step).abs();
            let [x, y, z] = (low + step).to_array().map(|index| index as usize);
            sum += weight.x * weight.y * weight.z * values[(z * shape[1] + y) * shape[0] + x];
        }
        sum
    };

    let (mut n_inside, mut n_beyond, mut warmest, mut farthest) = (0, 0, f64::NEG_INFINITY, 0.0_f64);
    for (pixel, _) in channel("A").iter().enumerate().filter(|&(_, &covered)| covered > 0.5) {
        let place = ["position.X", "position.Y", "position.Z"].map(|name| f64::from(channel(name)[pixel]));
        let place = DVec3::from_array(place);
        let voxel = voxel_from_world.transform_point3(place);
        let last = DVec3::from_array(shape.map(|extent| extent as f64 - 1.0));
        if voxel.min_element() < 0.0 || voxel.cmpge(last).any() {
            continue;
        }
        let (value, shown) = (sampled(place), f64::from(channel("volume.value")[pixel]));
        farthest = farthest.max((value - shown).abs());
        let node = channel("node.id")[pixel] as usize;
        // Beyond a tip is no air, and the root is cut from the throat.
        let is_end = node <= 1 || tree.children(node).is_empty();
        if is_end {
            continue;
        }
        if channel("across.mm")[pixel].abs() < 0.5 * channel("radius.mm")[pixel] {
            warmest = warmest.max(value);
            n_inside += 1;
        } else {
            n_beyond += usize::from(value > -300.0);
        }
    }
    // Air has -1000 HU, the wall over 0; beside them are the noise and the blur of the scan.
    assert!(n_inside > 1000 && n_beyond > 300, "{n_inside} inside, {n_beyond} of walls");
    assert!(warmest < -600.0, "{warmest} HU inside of the airway");
    // Positions are rounded to a 256th of a pixel, which at a wall is some HU.
    assert!(farthest < 20.0, "the picture and the scan differ by {farthest} HU");
}
