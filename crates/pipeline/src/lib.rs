//! One config, every stage: the only place where stages meet.
//!
//! | step | module |
//! |---|---|
//! | a TOML file, its overrides, and exact places for what is wrong in it | [`config`] |
//! | the stages, their order, what each reads and writes | [`stage`] |
//! | hand-over data, from memory or from the run folder | `artifacts` |
//! | what each stage does with them | `steps`, `tree_outputs` |
//! | the loop over the stages | [`run`](mod@run) |
//! | methods and runs side by side | [`compare`](mod@compare) |
//! | two runs on one shared map | [`juxtapose`](mod@juxtapose) |
//! | a config at many settings | [`sweep`](mod@sweep) |
//! | one page over many runs | [`group`](mod@group) |
//! | many scans from one table, and the page over them | [`cohort`] |
//! | the scans of a BIDS data set | [`bids`](mod@bids) |
//! | the run folder: atomic files, digests; one run at a time | `folder`, `lock` |
//! | what a stage's results were made from, and whether they still stand | `record` |
//! | results that runs share | `cache` |
//! | what a stage costs, before it is done | [`estimate`] |
//! | what an input is, and what suits it | [`doctor()`] |
//! | how a result came about, what each method cost, why a run stopped | `provenance`, `methods`, `failure` |
//! | the page of a run: what it is made from | `page` |
//! | what the columns of the tables mean | `dictionary` |
//! | what each error and warning code means | [`mod@explain`] |
//! | what a run tells while it goes on, and as lines of JSON | `event`, [`event_lines`] |
//! | what this program is, reads and writes | [`mod@info`] |
//! | a point of the scan on the map, and back | [`mod@locate`] |
//! | the calibre on the way to a place, as a table or a plot | [`profile()`], [`plot_profile`] |
//! | a run folder held against itself | [`verify()`] |
//!
//! **Architecture Invariant:** a stage is handed what its predecessor *wrote*, as it would be read back: a run
//! that starts in the middle gives the same bytes as one that starts at the beginning.
//!
//! **Architecture Invariant:** nothing is printed here; the caller is told by [`Event`]s.

mod artifacts;
pub mod bids;
mod cache;
mod clock;
pub mod cohort;
pub mod compare;
pub mod config;
mod dictionary;
mod doctor;
mod error;
pub mod estimate;
mod event;
pub mod event_lines;
pub mod explain;
mod failure;
mod folder;
pub mod group;
pub mod info;
pub mod juxtapose;
mod labels;
pub mod locate;
mod lock;
mod methods;
mod page;
mod phantom;
mod profile;
mod provenance;
mod record;
pub mod run;
mod scan_of_map;
mod scan_of_walls;
mod settings;
mod shell;
mod side_file;
mod space;
pub mod stage;
mod steps;
pub mod sweep;
mod tree_outputs;
mod verify;

pub use bids::{BidsRequest, bids};
pub use cache::Cache;
pub use cohort::{
    Absent, Cohort, CohortPage, CohortRequest, Effort, FailedSample, Hold, PageRequest, Sample, Turn, Word,
};
pub use compare::{CompareRequest, Compared, Subject, compare};
pub use config::{Config, ConfigError, Loaded, Override};
pub use doctor::{Advice, DoctorRequest, Examined, Fact, costs_table, doctor};
pub use error::{Error, NotSwept};
pub use espalier_juxtapose::{Align, Params as JuxtaposeParams};
pub use espalier_render::ChangeOf;
pub use espalier_verify::{Check, Outcome};
pub use espalier_volume::is_dicom_folder;
pub use event::{Event, Setting, Took};
pub use explain::{catalogue, explain};
pub use group::{GroupRequest, Grouped, group};
pub use juxtapose::{JuxtaposeRequest, JuxtaposedRuns, juxtapose};
pub use locate::{Given, Located, Space, locate, read_point, read_points};
pub use phantom::make_phantom;
pub use profile::{PlotRequest, Plotted, WayTo, plot_profile, profile};
pub use provenance::{input_of_run, side_file_of_run};
pub use record::Reason;
pub use run::{Plan, Request, Summary, plan, run};
pub use settings::Difference;
pub use side_file::SideFile;
pub use stage::{Artifact, Stage};
pub use sweep::{Axis, SweepRequest, Swept, sweep};
pub use verify::{Verification, verify};
