"""The script builds a model from arrays, prints its scores and draws a picture. With two terms in
each of four segments, the error of the model is about half as large as the error of a cubic
polynomial in both inputs. (The data are five simulated curves, and not the recordings of the page
First model.)
"""

from muscle import STUDY, recording, save

import mapmore_cli as mm

model = mm.fit(
    recording([80, 150, 200, 250, 350]), split={"validate": {"pressure": [200]}}, **STUDY
)
print(model.scores)
axes = model.plot()
save(axes.figure, "first_model")
