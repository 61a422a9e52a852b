//! The code of each error, and its class, which decides the exit code.

use std::path::Path;

use espalier_model::diagnose::{Class, Diagnose};

use super::{Error, hints, places};

impl Diagnose for Error {
    fn code(&self) -> &'static str {
        match self {
            Self::Config(error) => error.code(),
            Self::Stage { cause, .. } | Self::File { cause, .. } => cause.code(),
            Self::MissingArtifact { .. } => "E-RUN-MISSING-FILE",
            Self::NoSuchPlace { .. } => "E-PROFILE-PLACE",
            Self::PlotFormat { .. } | Self::ResultInTheWay { .. } => "E-PROFILE-PLOT",
            Self::InputInTheWay { .. } => "E-RUN-INPUT-IN-WAY",
            Self::FileInTheWay { .. } | Self::FolderInTheWay { .. } => "E-RUN-IN-WAY",
            Self::Point { cause, .. } => cause.code(),
            Self::NoSuchSpace { .. } => "E-LOCATE-SPACE",
            Self::NoRun { .. } => "E-COMPARE-NO-RUN",
            Self::Samples { .. } => "E-COHORT-TABLE",
            Self::NoSample { .. } => "E-COHORT-NO-SCAN",
            Self::Cohort { .. } => "E-COHORT-FAILED",
            Self::BidsDataset { .. } => "E-BIDS-DATASET",
            Self::BidsOutput { .. } => "E-BIDS-OUTPUT",
            Self::BidsSuffix { .. } => "E-BIDS-SUFFIX",
            Self::NoBidsScan { .. } => "E-BIDS-NO-SCAN",
            Self::NoBidsLabel { .. } => "E-BIDS-LABEL",
            Self::NoGroup { .. } => "E-GROUP-NO-RUN",
            Self::GroupSize { .. } => "E-GROUP-SIZE",
            Self::RunInTheWay { .. } => "E-COMPARE-FOLDER",
            Self::Settled { .. } => "E-COMPARE-SETTINGS",
            Self::SettledTree { .. } => "E-JUXTAPOSE-SETTINGS",
            Self::NoTree { .. } => "E-JUXTAPOSE-NO-TREE",
            Self::NotSwept { .. } | Self::SweepSize { .. } => "E-SWEEP",
            Self::Altered { .. } => "E-RUN-ALTERED-FILE",
            Self::Certificate { .. } => "E-RUN-CERTIFICATE",
            Self::Unverified { .. } => "E-VERIFY",
            Self::NoSuchStage { .. } | Self::EmptyRange { .. } => "E-RUN-STAGES",
            Self::Input { .. } => "E-INPUT",
            Self::OtherSettings { .. } => "E-RUN-SETTINGS",
            Self::OtherInput { .. } => "E-RUN-INPUT",
            Self::Read { .. } => "E-IO-READ",
            Self::TooLarge { .. } | Self::Memory { .. } => "E-LIMIT-MEMORY",
            Self::Create { .. } => "E-IO-CREATE",
            Self::Write { .. } => "E-IO-WRITE",
            Self::Print { .. } => "E-IO-PRINT",
            Self::Locked { .. } => "E-RUN-LOCKED",
            Self::Threads { .. } => "E-RUN-THREADS",
            Self::UnknownCode { .. } => "E-EXPLAIN-CODE",
            Self::UnknownKey { .. } => "E-EXPLAIN-KEY",
        }
    }

    fn class(&self) -> Class {
        match self {
            Self::Config(error) => error.class(),
            Self::Stage { cause, .. } | Self::File { cause, .. } => cause.class(),
            Self::Point { cause, .. } => cause.class(),
            Self::Cohort { cause, .. } => cause.class(),
            Self::Samples { .. }
            | Self::NoSample { .. }
            | Self::BidsSuffix { .. }
            | Self::NoBidsLabel { .. }
            | Self::NoSuchStage { .. }
            | Self::NoSuchPlace { .. }
            | Self::PlotFormat { .. }
            | Self::ResultInTheWay { .. }
            | Self::InputInTheWay { .. }
            | Self::NoSuchSpace { .. }
            | Self::EmptyRange { .. }
            | Self::Input { .. }
            | Self::OtherSettings { .. }
            | Self::OtherInput { .. }
            | Self::RunInTheWay { .. }
            | Self::Settled { .. }
            | Self::SettledTree { .. }
            | Self::NotSwept { .. }
            | Self::SweepSize { .. }
            | Self::GroupSize { .. }
            | Self::UnknownCode { .. }
            | Self::UnknownKey { .. }
            | Self::Threads { .. } => Class::Usage,
            Self::BidsDataset { .. } => Class::Input,
            Self::NoRun { .. }
            | Self::NoGroup { .. }
            | Self::NoBidsScan { .. }
            | Self::NoTree { .. }
            | Self::MissingArtifact { .. }
            | Self::Read { .. }
            | Self::Write { .. }
            | Self::Print { .. } => Class::Io,
            Self::Altered { .. } | Self::Certificate { .. } | Self::Unverified { .. } => Class::Uncertified,
            Self::TooLarge { .. } | Self::Memory { .. } => Class::Limit,
            Self::Create { .. }
            | Self::FileInTheWay { .. }
            | Self::FolderInTheWay { .. }
            | Self::BidsOutput { .. } => Class::CannotCreate,
            Self::Locked { .. } => Class::Locked,
        }
    }

    fn hint(&self) -> String {
        hints::of(self)
    }

    fn file(&self) -> Option<&Path> {
        places::file(self)
    }

    fn line(&self) -> Option<usize> {
        places::line(self)
    }
}
