//! The search of orders as tables.

use crate::identify::output::Results;
use crate::identify::report::percent;
use airloop::Error;
use airloop_ident::arx;
use airloop_ident::order_search::{Candidate, FIT_MARGIN, recommended};
use airloop_ident::structure::{Structure, text};
use airloop_report::plot::fit_page::Table;

/// Candidates on the terminal.
pub const CANDIDATES_ON_TERMINAL: usize = 10;
/// Candidates on the page.
const CANDIDATES_ON_PAGE: usize = 15;

/// The structure to take.
///
/// # Errors
/// No structure is stable; the reason of the first that cannot be estimated, if none could.
pub fn chosen(candidates: &[Candidate]) -> Result<Structure, Error> {
    if let Some(index) = recommended(candidates) {
        return Ok(candidates[index].structure.clone());
    }
    let estimated = candidates.iter().filter(|candidate| candidate.stable.is_some()).count();
    if candidates.iter().any(|candidate| candidate.stable == Some(true)) {
        // Stable, but without a fit: the judging data do not move, or are too short.
        return Err(arx::Error::NotJudged.into());
    }
    Err(match estimated {
        0 => {
            let problem = candidates.iter().find_map(|candidate| candidate.problem.clone());
            arx::Error::NoStructure { problem: problem.unwrap_or_default() }
        }
        _ => arx::Error::NoneStable { estimated },
    }
    .into())
}

/// Adds the search to the results: `orders.csv`, a table on the page, the sentence of the verdict.
pub fn add(results: &mut Results, candidates: &[Candidate], outputs: &[String]) {
    results.texts.push(("orders.csv".into(), csv(candidates, outputs)));
    let mut page = table(candidates, outputs, CANDIDATES_ON_PAGE);
    page.heading = "Orders, by simulated fit on judging data".into();
    results.tables.push(page);
    let estimated = candidates.iter().filter(|candidate| candidate.stable.is_some()).count();
    let stable = candidates.iter().filter(|candidate| candidate.stable == Some(true)).count();
    if let Some(taken) = recommended(candidates) {
        let (best, taken) = (&candidates[0], &candidates[taken]);
        results.summary.verdict.insert(
            0,
            format!(
                "orders {}: the least BIC of all with a simulated fit within {FIT_MARGIN} points of the best ({} % with {}), of {} structures, {stable} of them stable",
                taken.structure,
                percent(best.fit, true),
                best.structure,
                candidates.len(),
            ),
        );
    }
    if estimated < candidates.len() {
        let (missing, all) = (candidates.len() - estimated, candidates.len());
        let reason = candidates.iter().find_map(|candidate| candidate.problem.as_deref()).unwrap_or_default();
        results
            .summary
            .warnings
            .push(format!("{missing} of {all} structures could not be estimated: {reason}"));
    }
}

/// The best candidates.
pub fn table(candidates: &[Candidate], outputs: &[String], shown: usize) -> Table {
    let header = ["orders", "coefficients", "simulated fit [%]"].map(str::to_owned).into_iter();
    let criteria = ["AICc", "BIC", "MDL"].map(str::to_owned);
    let several = outputs.len() > 1;
    let names = outputs.iter().filter(|_| several).cloned();
    let taken = recommended(candidates);
    let row = |(index, candidate): (usize, &Candidate)| {
        let mark = if taken == Some(index) { " (taken)" } else { "" };
        let stable = candidate.stable == Some(true);
        let fit = match candidate.stable {
            None => "not estimated".to_owned(),
            Some(stable) => percent(candidate.fit, stable),
        };
        let fits = candidate.fits.iter().filter(|_| several).map(|fit| percent(*fit, stable));
        let criteria = [candidate.aicc, candidate.bic, candidate.mdl];
        let criteria = criteria.map(|value| value.map_or("-".into(), |value| format!("{value:.1}")));
        let first = [format!("{}{mark}", candidate.structure), candidate.parameters.to_string(), fit];
        first.into_iter().chain(fits).chain(criteria).collect()
    };
    Table {
        sentences: false,
        heading: String::new(),
        header: header.chain(names).chain(criteria).collect(),
        // The one that is taken is shown, however far down it stands.
        rows: candidates
            .iter()
            .enumerate()
            .filter(|(index, _)| *index < shown || taken == Some(*index))
            .map(row)
            .collect(),
    }
}

fn csv(candidates: &[Candidate], outputs: &[String]) -> String {
    let mut lines = vec![format!(
        "rank,na,nb,nk,coefficients,stable,fit_simulated,{},aicc,bic,mdl,taken",
        outputs
            .iter()
            .map(|name| format!("\"fit_{}\"", name.replace('"', "\"\"")))
            .collect::<Vec<_>>()
            .join(",")
    )];
    let recommended = recommended(candidates);
    let number = |value: Option<f64>| value.map_or(String::new(), |value| value.to_string());
    for (index, candidate) in candidates.iter().enumerate() {
        let orders =
            [&candidate.structure.na, &candidate.structure.nb, &candidate.structure.nk].map(|o| text(o));
        let fits: Vec<String> = candidate.fits.iter().map(|fit| number(*fit)).collect();
        let stable = candidate.stable.map_or(String::new(), |stable| stable.to_string());
        let criteria = [candidate.aicc, candidate.bic, candidate.mdl].map(number);
        lines.push(format!(
            "{},{},{},{stable},{},{},{},{}",
            index + 1,
            orders.join(","),
            candidate.parameters,
            number(candidate.fit),
            fits.join(","),
            criteria.join(","),
            recommended == Some(index)
        ));
    }
    lines.join("\n") + "\n"
}

#[cfg(test)]
mod tests {
    use super::*;

    fn candidate(stable: Option<bool>) -> Candidate {
        Candidate {
            structure: Structure::uniform((1, 1), 1, 1, 0),
            parameters: 2,
            stable,
            fit: None,
            fits: vec![None],
            aicc: None,
            bic: None,
            mdl: None,
            problem: stable.is_none().then(|| "too few".into()),
        }
    }

    #[test]
    fn without_a_fit_the_reason_is_told_with_a_remedy() {
        let message = |stable: [Option<bool>; 2]| chosen(&stable.map(candidate)).unwrap_err().to_string();
        let unstable = message([Some(false), Some(false)]);
        assert!(unstable.contains("none of the 2 structures"), "{unstable}");
        assert!(unstable.contains("--detrend mean"), "{unstable}");
        assert!(message([None, None]).ends_with("too few"));
        assert!(message([Some(true), None]).contains("judging data"));
    }
}
