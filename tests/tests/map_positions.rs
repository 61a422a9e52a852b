//! The map knows where each of its pixels lies in the patient: a CT sampled through the EXR shows air in the airways.
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
fn the_ct_sampled_through_the_map_is_air() {
    let folder = tempfile::tempdir().expect("a folder");
    let config = Path::new(env!("CARGO_MANIFEST_DIR")).join("../pipelines/airway.toml");
    let settings = [
        set("phantom.generations", 3),
        set("phantom.spacing_mm", "[1.5, 1.5, 1.5]"),
        set("embed.pso.particles", 24),
        set("embed.pso.iterations", 4),
        set("render.width_px", 400),
    ];
    run(&config, folder.path(), &settings, 2).expect("a run");
    let ct = folder.path().join("stages/00-phantom/ct.nii.gz");
    let channels = channels(&fs::read(folder.path().join("planar.exr")).expect("planar.exr"));
    let channel = |name: &str| &channels.iter().find(|(known, _)| known == name).expect(name).1;
    let volume = espalier_volume::read(&ct, &ReadOptions::default()).expect("a CT").volume;
    let shape = volume.grid().shape();
    let values = volume.map_values(|value| value);
    let voxel_from_world = volume.grid().voxel_from_world();

    let (mut n_sampled, mut warmest) = (0, f64::NEG_INFINITY);
    for (pixel, _) in channel("A").iter().enumerate().filter(|&(_, &covered)| covered > 0.5) {
        let place = ["position.X", "position.Y", "position.Z"].map(|name| f64::from(channel(name)[pixel]));
        let voxel = voxel_from_world.transform_point3(DVec3::from_array(place)).round();
        let [x, y, z] = voxel.to_array().map(|index| index as usize);
        warmest = f64::max(warmest, values[(z * shape[1] + y) * shape[0] + x]);
        n_sampled += 1;
    }
    // Air has -1000 HU, the wall over 0; beside them are the noise and the blur of the scan.
    assert!(n_sampled > 1000, "{n_sampled}");
    assert!(warmest < -700.0, "{warmest} HU inside of the airway");
}
