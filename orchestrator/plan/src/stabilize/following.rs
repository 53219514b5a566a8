//! Phases of a plan for the regulator: rows of the trajectory, events between phases, and the output that tells them.

use std::ops::Range;

use super::Settings;
use super::design::Plan;
use super::wiring::find;
use crate::Error;
use crate::cycle::Return;
use crate::file::Place;
use crate::prepare::Setup;
use crate::reset::Jump;
use crate::task::{Signal, seconds};
use airloop_cosim::system::graph::DataType;
use airloop_ocp::control::{self, Event, Leg, Nominal, Phases, phases};
use airloop_ocp::transcription::Reset;

/// Default time by which the trajectory of a phase goes beyond its ends \[s\].
const OVERLAP: f64 = 0.05;
/// Default time by which the regulator looks beyond the end of the plan \[s\].
const HORIZON: f64 = 2.0;

/// A plan on the samples.
pub(super) enum Plant<'a> {
    One(Leg<'a>, Nominal),
    Several(Phases<'a>),
}

impl<'a> Plant<'a> {
    /// Of the legs of a plan, which may repeat itself.
    pub(super) fn new(mut legs: Vec<Leg<'a>>, repeats: bool) -> Result<Plant<'a>, control::Error> {
        match (legs.pop(), legs.is_empty() && !repeats) {
            (Some(mut one), true) => {
                let nominal = Nominal::new(&mut one.plant, &one.knots)?;
                Ok(Plant::One(one, nominal))
            }
            (last, _) => {
                legs.extend(last);
                Phases::new(legs).map(Plant::Several)
            }
        }
    }

    pub(super) fn nominal(&self) -> &Nominal {
        match self {
            Plant::One(_, nominal) => nominal,
            Plant::Several(phases) => &phases.nominal,
        }
    }
}

/// Rows of every phase, by the column `phase` of a trajectory that has several.
pub(super) fn sections(plan: Plan<'_>, phases: usize) -> Result<Vec<Range<usize>>, Error> {
    if phases == 1 {
        return Ok(std::iter::once(0..plan.trajectory.len()).collect());
    }
    let place = |problem: String| Error::Place { place: plan.file.display().to_string(), problem };
    let column = plan.trajectory.channel("phase").ok_or_else(|| {
        place(format!(
            "there is no column `phase`, and the problem has {phases} phases; give its own trajectory"
        ))
    })?;
    (1..=phases)
        .map(|number| {
            let own = |value: &&f64| **value == number as f64;
            let rows = column.values.iter().filter(own).count();
            let first = column.values.iter().position(|value| *value == number as f64);
            match first
                .filter(|&first| rows >= 2 && column.values[first..first + rows].iter().all(|v| own(&v)))
            {
                Some(first) => Ok(first..first + rows),
                None => Err(place(format!(
                    "column `phase`: the rows of phase {number} are not two or more in a row"
                ))),
            }
        })
        .collect()
}

/// Events between the phases.
pub(super) struct Following {
    pub how: phases::Following,
    pub events: Vec<Event>,
    /// Component and output that tell the phase.
    pub mode: Option<(usize, usize)>,
}

impl Following {
    pub(super) fn of(
        setup: &Setup,
        settings: &Settings,
        resets: &[Option<Jump>],
        cycle: Option<&Return>,
    ) -> Result<Following, Error> {
        let source = &settings.source;
        let count = setup.task.phases.len();
        // In a cycle the last phase ends with an event, too.
        let ends = if cycle.is_some() { count } else { count - 1 };
        let own = settings.phases.as_ref().ok_or_else(|| {
            let problem = format!(
                "the plan has {count} phases; add [phases] with `guards`, the {ends} outputs that pass through zero where \
                 they end",
            );
            source.error_at(Place(0), problem)
        })?;
        let start = own.guards.first().map_or(Place(0), |guard| guard.place);
        if own.guards.len() != ends {
            let wanted =
                if cycle.is_some() { "in a cycle give one per phase" } else { "give one fewer than phases" };
            let problem = format!("{} guards for {count} phases; {wanted}", own.guards.len());
            return Err(source.error_at(start, problem));
        }
        let mut events = Vec::new();
        let jumps = resets.iter().map(Some).chain([None]);
        for (guard, jump) in own.guards.iter().zip(jumps) {
            let (index, _) = setup.catalog.want(source, guard)?;
            let Some(Signal::Output(guard)) = setup.task.signals.of(index) else {
                let problem =
                    format!("`{}` is not an output that the problem names; bound it there", guard.text);
                return Err(source.error_at(guard.place, problem));
            };
            let reset: Option<Box<dyn Reset>> = match (jump, cycle) {
                (Some(jump), _) => jump.as_ref().map(Jump::reset).transpose()?,
                (None, Some(cycle)) => Some(Box::new(cycle.reset()?)),
                (None, None) => None,
            };
            events.push(Event { guard, reset });
        }
        let mut mode = None;
        if let Some((name, modes)) = own.mode.as_ref().zip(own.modes.as_ref()) {
            // In a cycle the design knows after how many turns states are back in their places.
            if modes.len() != count && (cycle.is_none() || modes.len() % count != 0) {
                let problem = format!("{} modes for {count} phases; give one per phase", modes.len());
                return Err(source.error_at(name.place, problem));
            }
            let found = find(&setup.graph, &name.text);
            let whole = found.is_some_and(|(component, variable)| {
                let description = &setup.graph.components[component].fmu.description;
                matches!(
                    DataType::of(&description.variables[variable]),
                    DataType::Integer | DataType::Enumeration
                )
            });
            if !whole {
                let problem = format!(
                    "`{}` is not an Integer or enumeration of a component; write component.variable",
                    name.text
                );
                return Err(source.error_at(name.place, problem));
            }
            mode = found;
        }
        let time =
            |quantity: &Option<_>, none: f64| quantity.as_ref().map_or(Ok(none), |one| seconds(source, one));
        let how = phases::Following {
            modes: own.modes.clone(),
            overlap: time(&own.overlap, OVERLAP)?,
            horizon: time(&own.horizon, HORIZON)?,
        };
        Ok(Following { how, events, mode })
    }
}
