//! The way out of each error: what the user can do about it; nothing where the message says it all.

use std::io;

use espalier_model::diagnose::Diagnose;

use super::Error;
use crate::stage::Stage;

/// What can be done about an error.
pub(super) fn of(error: &Error) -> String {
    match error {
        Error::Config(cause) => cause.hint(),
        Error::Stage { cause, .. } | Error::File { cause, .. } => cause.hint(),
        Error::Unverified { .. } => "use none of it; make it again with espalier run".to_owned(),
        Error::Certificate { .. } => "make the embedding again with espalier embed".to_owned(),
        Error::NoSuchPlace { .. } => "branches.tsv has the branches, nodes.tsv the nodes".to_owned(),
        Error::PlotFormat { .. } => "name it with one of these endings".to_owned(),
        Error::ResultInTheWay { .. } => "choose another name for the plot".to_owned(),
        Error::InputInTheWay { .. } => "choose another folder with -o".to_owned(),
        Error::FileInTheWay { .. } => {
            "move it away, or choose another folder with -o; --force writes over it or removes it".to_owned()
        }
        Error::FolderInTheWay { .. } => "move it away, or choose another folder with -o".to_owned(),
        Error::Point { cause, .. } => cause.hint(),
        Error::NoSuchSpace { .. } => "give points in RAS+ mm, with --lps in LPS+ mm, or on the map in mm".to_owned(),
        Error::NoRun { .. } => "run it with this version, at least up to --to embed".to_owned(),
        Error::NoTree { .. } => "run it with this version, at least up to --to tree".to_owned(),
        Error::SettledTree { .. } => {
            "of finished runs seed, views.*, embed.* and render.* can be changed; or give the configs".to_owned()
        }
        Error::Samples { .. } => {
            "columns are id, path, config, preset, label, labels, image, series, volume_index, seed, keys of the config such as embed.w_angle, and notes such as note or note.age; an empty cell or n/a says nothing".to_owned()
        }
        Error::NoSample { .. } => "the column id has the ids".to_owned(),
        Error::BidsDataset { .. } => "mend it, or take the data set as it is with --skip-bids-validation".to_owned(),
        Error::BidsOutput { .. } => "name a folder of its own for the results, such as derivatives/espalier".to_owned(),
        Error::BidsSuffix { .. } => "say which with --suffix, and --filter desc=… if one kind has several".to_owned(),
        Error::NoBidsScan { .. } => "volumes lie in sub-*/[ses-*/] and end with .nii or .nii.gz; see --suffix and --filter".to_owned(),
        Error::NoBidsLabel { .. } => "labels are what stands after sub- and ses-".to_owned(),
        Error::Cohort { .. } => "failures.tsv has the reasons, and the command that tries each again".to_owned(),
        Error::NoGroup { .. } => {
            "name run folders, or a folder that has run folders in it, such as the one that espalier run writes to".to_owned()
        }
        Error::GroupSize { .. } => "show them in several groups".to_owned(),
        Error::RunInTheWay { .. } => "choose another folder with -o".to_owned(),
        Error::NotSwept { .. } => "write --over KEY=V1,V2,…, such as --over embed.w_length=0.5,1,2,4".to_owned(),
        Error::SweepSize { .. } => "give fewer values, or sweep one key at a time".to_owned(),
        Error::Settled { .. } => "of a finished run only render.* can be changed; or compare its config".to_owned(),
        Error::UnknownKey { nearest, .. } if nearest.is_empty() => {
            "espalier config explain lists all keys".to_owned()
        }
        Error::UnknownKey { nearest, .. } => format!("did you mean {}?", nearest.join(" or ")),
        Error::UnknownCode { nearest, .. } if nearest.is_empty() => "espalier explain lists all codes".to_owned(),
        Error::UnknownCode { nearest, .. } => {
            format!("did you mean {}? espalier explain lists all codes", nearest.join(" or "))
        }
        Error::MissingArtifact { .. } => "start from an earlier stage with --from, or name the file".to_owned(),
        Error::Altered { .. } => {
            "run the stage that makes it again; or, if the edit is meant, give the file to the stage's own \
             command with -o to another folder"
                .to_owned()
        }
        Error::Read { source, .. } if source.kind() == io::ErrorKind::NotFound => {
            "check the path; a path in a config is relative to the config's own folder".to_owned()
        }
        Error::Read { source, .. } if source.kind() == io::ErrorKind::IsADirectory => {
            "name a file: a config (.toml), a volume (.nii, .nii.gz, .hdr, .nrrd, .nhdr, .mha, .mhd) or a traced tree (.swc, .vtp, .vtk)".to_owned()
        }
        Error::OtherSettings { difference, .. } => {
            format!("run with --from {}, or set {} back", difference.stage, difference.key)
        }
        Error::OtherInput { first, .. } => format!("run with --from {first}, or choose another folder with -o"),
        Error::Input { .. } => "set it to the folder of the data".to_owned(),
        Error::TooLarge { .. } => "allow more with --max-memory".to_owned(),
        Error::Memory { stage: Stage::Render, .. } => {
            "allow more with --max-memory, or take less with render.width_px, or render.space = false".to_owned()
        }
        Error::Memory { stage: Stage::Embed | Stage::Views, .. } => {
            "allow more with --max-memory, or take fewer nodes with tree.resample".to_owned()
        }
        Error::Memory { .. } => {
            "allow more with --max-memory, or take coarser voxels with volume.resample_mm".to_owned()
        }
        Error::Create { .. } => "choose another place for it with -o (a plot: with --plot)".to_owned(),
        Error::Write { .. } => "check the free space and the permissions of the folder".to_owned(),
        Error::Print { .. } => "what was done is in place; send standard output to where there is room".to_owned(),
        Error::Locked { .. } => "wait for it with --wait, or choose another folder with -o".to_owned(),
        Error::NoSuchStage { .. } | Error::EmptyRange { .. } | Error::Read { .. } | Error::Threads { .. } => {
            String::new()
        }
    }
}
