import type { PanelFactory } from "../panel";

export const allan: PanelFactory = () => ({ element: document.createElement("div") });
